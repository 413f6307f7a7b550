"""Description of the API for programs: an OpenAPI 3.1 document, from the message classes."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Mapping
from typing import Any, NamedTuple, Union

import msgspec
from starlette.requests import Request as HttpRequest
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from katana450.arm.control.commands.act import Request, tag_of
from katana450.arm.control.commands.checked import field_schema
from katana450.server.api import answers, requests
from katana450.server.api.fields import MAX_PRESS_LENGTH, ROOT
from katana450.server.web.http_api import QUERY_SUBJECTS, RouteContext

TITLE = "katana450"

LICENSE = {"name": "MIT", "identifier": "MIT"}

ABOUT = (
    "Every message is a JSON object: `do` names a request, `is` an answer. Lengths are in m, "
    "angles in rad, times in s, unless a field says otherwise. One client at a time holds the "
    "lease, the right to drive. Everybody may stop the arm at any time."
)
"""Description of the API."""

REFERENCE = "#/components/schemas/{name}"
"""Reference to the schema of a class."""


def summary(kind: type) -> str:
    """Return the first line of the docstring of ``kind``."""
    return (inspect.getdoc(kind) or "").partition("\n")[0]


def documentation(kind: type) -> tuple[str, dict[str, str]]:
    """Return the docstring of ``kind`` as Markdown, and its ``Attributes`` by their names.

    These include the ones that it inherits.
    """
    text, fields = _divided(inspect.getdoc(kind) or "")
    for base in kind.__mro__[1:]:
        if issubclass(base, msgspec.Struct):
            fields = _divided(inspect.cleandoc(base.__doc__ or ""))[1] | fields
    return text, fields


def schemas(requests: tuple[type[Request], ...]) -> tuple[dict[str, Any], dict[str, Any], Any]:
    """Return the schemas of a request and of an answer, and those of all classes by name.

    Each field is described by the entry of its class under ``Attributes``. ``asked``: the requests
    of the server.
    """
    shapes: list[Any] = [Union[requests], Union[answers.EVERY]]  # noqa: UP007
    (request, answer), components = msgspec.json.schema_components(
        shapes, schema_hook=field_schema, ref_template=REFERENCE
    )
    components = {name: _portable(schema) for name, schema in components.items()}
    messages = {message.__name__: message for message in (*requests, *answers.EVERY)}
    for name, schema in components.items():
        text, fields = _divided(inspect.cleandoc(schema.get("description", "")))
        if name in messages:
            text, fields = documentation(messages[name])
        schema["description"] = text
        for field, about in fields.items():
            if field in schema.get("properties", ()):
                schema["properties"][field]["description"] = about
    return request, answer, components


def _portable(schema: Any) -> Any:
    """Return an equal of ``schema`` from which programs can generate clients.

    They cannot read the ``"items": false`` after the items of a tuple, so items that are alike get
    one schema. Of an enumeration with one value they would make a class.
    """
    if isinstance(schema, list):
        return [_portable(part) for part in schema]
    if not isinstance(schema, dict):
        return schema
    first, *others = schema.get("prefixItems", (None,))
    if first is not None and all(item == first for item in others):
        schema = {name: part for name, part in schema.items() if name != "prefixItems"}
        schema["items"] = first
    if len(schema.get("enum", ())) == 1:
        schema = {"const": schema["enum"][0]}
    return {name: _portable(part) for name, part in schema.items()}


def _divided(doc: str) -> tuple[str, dict[str, str]]:
    """Return the text of a docstring without its ``Attributes``, and these by their names."""
    text, _, attributes = doc.replace("``", "`").partition("Attributes:\n")
    entries = re.findall(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", attributes, flags=re.MULTILINE)
    return text.rstrip(), {name: " ".join(about.split()) for name, about in entries}


class Operation(NamedTuple):
    """One method of a path.

    Attributes:
        method, path: ``get`` or ``post``, and the path below ``/api/v1``.
        name: its name in generated clients.
        about: one line of text.
        answer: class of the answer, or media type of the content; None for no content.
        body: media type of the content that is sent; None for none.
        query: names of its parameters in the query, of ``PARAMETERS``.
    """

    method: str
    path: str
    name: str
    about: str
    answer: type | str | None
    body: str | None = None
    query: tuple[str, ...] = ()

    @property
    def description(self) -> dict[str, Any]:
        """The operation of OpenAPI."""
        described = _operation(self.name, self.about, self.answer)
        placed = re.findall(r"{(\w+)}", self.path)
        parameters = [
            *(_parameter(name, "path", PARAMETERS[name]) for name in placed),
            *(_parameter(name, "query", PARAMETERS[name]) for name in self.query),
        ]
        if parameters:
            described["parameters"] = parameters
        if self.body is not None:
            described["requestBody"] = _content(self.body, CONTENTS[self.body])
        return described


TEXT, OBJECT = {"type": "string"}, {"type": "object"}

JSON, BINARY, ZIP = "application/json", "application/octet-stream", "application/zip"

CONTENTS: Mapping[str, dict[str, Any]] = {
    JSON: OBJECT,
    BINARY: TEXT | {"format": "binary"},
    ZIP: TEXT | {"format": "binary"},
    "text/plain": TEXT,
    "application/yaml": TEXT,
    "application/schema+json": OBJECT,
}
"""Schema of each media type."""

PARAMETERS: Mapping[str, dict[str, Any]] = {
    "format": TEXT
    | {
        "description": "wrl, stl, obj, ply, glb, gltf, 3mf or zip, for a name without an "
        "ending. A zip holds one such file and the files that it names."
    },
    "from": {"type": "number", "description": "Begin [s since the epoch]."},
    "last": {"type": "number", "description": "Time before the present [s]."},
    "main": TEXT | {"description": "Path in a zip of the file to read, if there are several."},
    "name": TEXT | {"description": "Name, of a file with its ending."},
    "number": {"type": "integer", "description": "Number of the episode."},
    "press": TEXT
    | {
        "maxLength": MAX_PRESS_LENGTH,
        "description": "Name of this press. The same name again does not count again.",
    },
    "to": {"type": "number", "description": "End [s since the epoch]."},
    "unit": TEXT | {"description": "mm, cm, in or m. Without it the unit is guessed and reported."},
}
"""Schema of each parameter, with its description."""

TIMES = ("last", "from", "to")

ANSWERS = {tag_of(kind.__name__): kind for kind in answers.EVERY}
"""Class of each answer by its name."""

OPERATIONS = (
    *(
        Operation("get", subject, f"get_{subject}", summary(ANSWERS[subject]), ANSWERS[subject])
        for subject in QUERY_SUBJECTS
    ),
    Operation("post", "stop", "stop", summary(requests.Stop), None, None, ("press",)),
    Operation(
        *("post", "mesh", "upload_mesh", "Upload a mesh, which `place` then uses by its key."),
        *(answers.Mesh, BINARY, ("name", "format", "main", "unit")),
    ),
    Operation("get", "scene", "download_scene", "Download the scene and its meshes.", ZIP),
    Operation(
        *("post", "scene", "upload_scene", "Upload a scene, which `load` then uses by its key."),
        *(answers.Scene, ZIP),
    ),
    Operation("get", "robots", "list_robots", "List the robots that `choose_robot` takes.", JSON),
    Operation(
        *("post", "robots", "upload_robot"),
        "Upload a .urdf, .xacro or .zip, which `choose_robot` then takes by its name.",
        *(JSON, BINARY, ("name", "main")),
    ),
    Operation("get", "scripts", "list_scripts", "List the names of the scripts.", JSON),
    Operation(
        *("post", "scripts", "check_script"),
        "List the problems of a script by line. Nothing is planned.",
        *(JSON, "text/plain"),
    ),
    Operation("get", "scripts/{name}", "get_script", "Return the text of a script.", "text/plain"),
    Operation(
        *("post", "scripts/{name}", "save_script"),
        "Save a valid script under a new name in the folder of `--programs`.",
        *(None, "text/plain"),
    ),
    Operation(
        *("get", "script.schema.json", "get_script_schema", "Return the JSON Schema of scripts."),
        "application/schema+json",
    ),
    Operation("get", "openapi.json", "get_openapi", "Return this document.", JSON),
    Operation(
        *("get", "recording", "download_recording"),
        "Download what was recorded, at most ten minutes of motion.",
        *(BINARY, None, TIMES),
    ),
    Operation(
        *("get", "recording/script", "download_recording_script"),
        "Download a script that runs the recorded motion again.",
        *("application/yaml", None, TIMES),
    ),
    Operation(
        *("get", "episodes", "list_episodes", "List the episodes, and the one that runs."), JSON
    ),
    Operation(
        *("post", "episodes", "change_episodes", "Start, end, judge or change an episode."),
        *(JSON, JSON),
    ),
    Operation("get", "episodes/{number}", "download_episode", "Download an episode.", BINARY),
)
"""The paths beside `do`."""

REFUSALS = {
    "401": "A token is required.",
    "403": "The sender may not do this.",
    "404": "There is nothing of this name here.",
    "408": "The body was not received in time.",
    "409": "The request is refused at present.",
    "413": "The body is too large.",
    "422": "The body is invalid.",
    "429": "Too many requests, or too costly ones. `Retry-After` says when.",
    "503": "The arm is not ready yet.",
}
"""Refusals by status, each an ``answers.Refused``."""


def _operation(name: str, about: str, answer: type | str | None) -> dict[str, Any]:
    """Describe an operation by its name, one line of text, and its answer or its media type."""
    done: dict[str, Any] = {"description": "Done."}
    if isinstance(answer, str):
        done |= _content(answer, CONTENTS[answer])
    elif answer is not None:
        done |= _content(JSON, _reference(answer))
    refused = _content(JSON, _reference(answers.Refused))
    refusals = {status: {"description": why, **refused} for status, why in REFUSALS.items()}
    responses = {"204" if answer is None else "200": done, **refusals}
    return {"operationId": name, "summary": about, "responses": responses}


def _do(request: Any, answer: Any) -> dict[str, Any]:
    """Describe the path of single requests, by the schemas of requests and answers."""
    described = _operation("do", "Execute one request.", JSON)
    either = {"anyOf": [_reference(answers.Refused), _reference(answers.Done)]}
    described["responses"]["200"] |= _content(JSON, answer)
    described["responses"]["409"] = {
        "description": "Refused at present, or its motion did not reach its end.",
        **_content(JSON, either),
    }
    key = {
        "pattern": "^[A-Za-z0-9_-]{16,64}$",
        "description": "A secret key that identifies the program; others never see it.",
    }
    shown = {"maxLength": 40, "description": "The name of the program that others see."}
    return {
        **described,
        "description": "A request with `wait` is answered when its motion has ended; the open "
        "connection then counts as the heartbeat. After any other motion request the program sends "
        "ten requests a second until the arm rests, or the arm stops or pauses.",
        "parameters": [
            _parameter("X-Program", "header", TEXT | key) | {"required": True},
            _parameter("X-Name", "header", TEXT | shown),
        ],
        "requestBody": _content(JSON, request),
    }


def _content(media: str, schema: Any) -> dict[str, Any]:
    return {"content": {media: {"schema": schema}}}


def _reference(kind: type) -> dict[str, str]:
    return {"$ref": REFERENCE.format(name=kind.__name__)}


def _parameter(name: str, place: str, schema: Mapping[str, Any]) -> dict[str, Any]:
    """Describe a parameter at ``place``: in the path, the query or the header."""
    shape = {key: part for key, part in schema.items() if key != "description"}
    parameter = {"name": name, "in": place, "schema": shape, "description": schema["description"]}
    return parameter | ({"required": True} if place == "path" else {})


@functools.cache
def openapi_json(kinds: tuple[type[Request], ...], served: frozenset[str] | None = None) -> bytes:
    """Return the document as JSON.

    ``kinds``: the requests of the server. ``served``: paths of the server, of which only the first
    name below ``/api/v1`` counts; None to describe all paths.
    """
    request, answer, components = schemas(kinds)
    paths: dict[str, Any] = {}
    for operation in OPERATIONS:
        paths.setdefault(operation.path, {})[operation.method] = operation.description
    paths["do"] = {"post": _do(request, answer)}
    names = None if served is None else {_first(path.removeprefix(ROOT)) for path in served}
    document = {
        "openapi": "3.1.0",
        "info": {
            "title": TITLE,
            "version": str(requests.VERSION),
            "description": ABOUT,
            "license": LICENSE,
        },
        "servers": [{"url": "/", "description": "The server that this document is from."}],
        "security": [{}, {"link": []}],
        "paths": {
            f"{ROOT}/{path}": operations
            for path, operations in paths.items()
            if names is None or _first(path) in names
        },
        "components": {
            "schemas": components,
            "securitySchemes": {
                "link": {
                    "type": "http",
                    "scheme": "bearer",
                    "description": "Token of an access link, the part after its `#`, if the server "
                    "requires one.",
                }
            },
        },
    }
    return msgspec.json.encode(document)


def _first(path: str) -> str:
    """Return the first name of ``path``: `scripts` for `scripts/{name}`."""
    return path.strip("/").partition("/")[0].partition("{")[0]


def description_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the route of the OpenAPI document, which everybody may read.

    It describes the paths and requests of this server, also those of its extensions.
    """
    hub = context.hub

    async def openapi(request: HttpRequest) -> Response:
        present = frozenset(getattr(route, "path", "") for route in request.app.routes)
        return Response(openapi_json(hub.requests.kinds, present), media_type="application/json")

    return [Route(f"{ROOT}/openapi.json", openapi)]
