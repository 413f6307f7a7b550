"""Description of the API for programs: an OpenAPI 3.1 document, from the message classes."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Mapping
from typing import Any, Union

import msgspec
from starlette.requests import Request as HttpRequest
from starlette.responses import Response
from starlette.routing import BaseRoute, Route

from katana450.arm.control.act import Request
from katana450.arm.control.checked import field_schema
from katana450.server.api import answers, requests
from katana450.server.api.fields import MAX_PRESS_LENGTH, ROOT
from katana450.server.web.http_api import RouteContext

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


READABLE = {
    "state": answers.State,
    "arm": answers.Arm,
    "event_log": answers.EventLog,
    "branches": answers.Branches,
    "loop": answers.Loop,
    "objects": answers.Objects,
    "world": answers.World,
    "links": answers.Links,
}
"""Answers of the paths of single questions."""


@functools.cache
def openapi_json(kinds: tuple[type[Request], ...], served: frozenset[str] | None = None) -> bytes:
    """Return the document as JSON.

    ``kinds``: the requests of the server. ``served``: paths of the server, of which only the first
    name below ``/api/v1`` counts; None to describe all paths.
    """
    request, answer, components = schemas(kinds)
    paths: dict[str, Any] = {
        **{path: {"get": _question(path, kind)} for path, kind in READABLE.items()},
        "stop": {"post": _stop()},
        "do": {"post": _do(request, answer)},
        **_files(),
        **_scripts(),
        **_recordings(),
    }
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


def _operation(
    name: str,
    about: str,
    done: Mapping[str, Any],
    refusals: Mapping[int, str | dict[str, Any]] | None = None,
    **more: Any,
) -> dict[str, Any]:
    """Describe one operation.

    Args:
        name: its name in generated clients.
        about: one line of text.
        done: the response of success, of status 204 if it has no content.
        refusals: the other responses by their status, or what such an ``answers.Refused`` means,
            beside those of every path.
        more: further fields, such as its parameters.
    """
    responses = {
        status: _response(meaning, answers.Refused) if isinstance(meaning, str) else meaning
        for status, meaning in {**COMMON_REFUSALS, **(refusals or {})}.items()
    }
    responses[200 if "content" in done else 204] = dict(done)
    by_text = {str(status): responses[status] for status in sorted(responses)}
    return {"operationId": name, "summary": about, "responses": by_text, **more}


COMMON_REFUSALS: Mapping[int, str | dict[str, Any]] = {
    401: "A token is required.",
    403: "The sender may not do this.",
    429: "Too many requests, or too costly ones. `Retry-After` says when.",
}
"""Refusals of every path but the documents."""

NOT_READY = {503: "The arm is not ready yet."}

NO_VALUE = {409: "There is no such value.", **NOT_READY}

NOT_NOW = {409: "The request is refused at present."}

UNREADABLE = {422: "The file cannot be read.", 413: "The file is too large.", **NOT_READY}


def _question(path: str, kind: type) -> dict[str, Any]:
    done = _response("The present value.", kind)
    return _operation(f"get_{path}", summary(kind), done, NO_VALUE)


def _stop() -> dict[str, Any]:
    about = "Name of this press. The same name again does not count again."
    press = _query("press", about, maxLength=MAX_PRESS_LENGTH)
    done = {"description": "The stop is requested."}
    return _operation("stop", summary(requests.Stop), done, parameters=[press])


def _do(request: Any, answer: Any) -> dict[str, Any]:
    """Describe the path of single requests, by the schemas of requests and answers."""
    key = _parameter(
        "X-Program", "A secret key that identifies the program; others never see it.", "header"
    )
    key |= {"required": True}
    key["schema"]["pattern"] = "^[A-Za-z0-9_-]{16,64}$"
    name = _parameter("X-Name", "The name of the program that others see.", "header", maxLength=40)
    return _operation(
        "do",
        "Execute one request.",
        _json_response("The request is done, or its answer.", answer),
        {
            409: _json_response(
                "The request is refused at present, or its motion did not reach its end.",
                {"anyOf": [_reference(answers.Refused), _reference(answers.Done)]},
            ),
            422: "The request is invalid.",
            408: "The body was not received in time.",
            413: "The body is too large.",
        },
        description="A request with `wait` is answered when its motion has ended; the open "
        "connection then counts as the heartbeat. After any other motion request the program sends "
        "ten requests a second until the arm rests, or the arm stops or pauses.",
        parameters=[key, name],
        requestBody=_body("application/json", request),
    )


def _files() -> dict[str, Any]:
    """Describe the paths of meshes and scenes, by path."""
    parameters = [
        _query("name", "The file's name, with its ending.") | {"required": True},
        _query(
            "format",
            "wrl, stl, obj, ply, off, glb, gltf, dae, 3mf or zip, for a name "
            "without an ending. A zip holds one such file and the files that it names.",
        ),
        _query("main", "Path in a zip of the file to read, if there are several."),
        _query("unit", "mm, cm, in or m. Without it the unit is guessed and reported."),
    ]
    binary = {"type": "string", "format": "binary"}
    return {
        "mesh": {
            "post": _operation(
                "upload_mesh",
                "Upload a mesh, which `place` then uses by its key.",
                _response("The file is kept.", answers.Mesh),
                UNREADABLE,
                parameters=parameters,
                requestBody=_body("application/octet-stream", binary),
            )
        },
        "scene": {
            "get": _operation(
                "download_scene",
                "Download the scene as a .zip of scene.yaml and its meshes.",
                _content("The present scene.", "application/zip"),
                NOT_NOW,
            ),
            "post": _operation(
                "upload_scene",
                "Upload a scene, which `load` then uses by its key.",
                _response("The file is kept.", answers.Scene),
                UNREADABLE,
                requestBody=_body("application/zip", binary),
            ),
        },
        "robots": {
            "get": _operation(
                "list_robots",
                "List the robots that `choose_robot` takes.",
                _json_response("Names, makers, licences and arguments of xacro files.", _OBJECT),
            ),
            "post": _operation(
                "upload_robot",
                "Upload a .urdf, .xacro or .zip, which `choose_robot` then takes by its name.",
                _json_response("The robot is kept.", _OBJECT),
                UNREADABLE,
                parameters=[parameters[0], parameters[2]],
                requestBody=_body("application/octet-stream", binary),
            ),
        },
    }


def _scripts() -> dict[str, Any]:
    """Describe the paths of scripts, by path."""
    name = _parameter("name", "", "path")
    text = _body("text/plain", {"type": "string"})
    names = _json_response("The names, and whether texts can be saved.", _OBJECT)
    problems = _json_response("The problems, and the taught poses.", _OBJECT)
    return {
        "scripts": {
            "get": _operation("list_scripts", "List the names of the scripts.", names),
            "post": _operation(
                "check_script",
                "List the problems of a script by line. Nothing is planned.",
                problems,
                requestBody=text,
            ),
        },
        "scripts/{name}": {
            "get": _operation(
                "get_script",
                "Return the text of a script.",
                _content("The text.", "text/plain"),
                {404: "There is no script of this name."},
                parameters=[name],
            ),
            "post": _operation(
                "save_script",
                "Save a valid script under a new name in the folder of `--programs`.",
                {"description": "The script is saved."},
                {409: "It cannot be saved, and why.", 422: "It is not a valid script, and why."},
                parameters=[name],
                requestBody=text,
            ),
        },
        "script.schema.json": _document(
            "get_script_schema", "Return the JSON Schema of scripts.", "application/schema+json"
        ),
        "openapi.json": _document("get_openapi", "Return this document.", "application/json"),
    }


def _recordings() -> dict[str, Any]:
    """Describe the paths of recordings and episodes, by path."""
    times = [
        _query("last", "Time before the present [s].", type="number"),
        _query("from", "Begin [s since the epoch].", type="number"),
        _query("to", "End [s since the epoch].", type="number"),
    ]
    number = _parameter("number", "", "path", type="integer")
    file = _content("An MCAP file.", "application/octet-stream")
    none = {404: "There is no such recording here."}
    empty = {409: "Nothing was recorded, and why.", **none}
    return {
        "recording": {
            "get": _operation(
                "download_recording",
                "Download what was recorded, at most ten minutes of motion.",
                file,
                empty,
                parameters=times,
            )
        },
        "recording/script": {
            "get": _operation(
                "download_recording_script",
                "Download a script that runs the recorded motion again.",
                _content("The script.", "application/yaml"),
                empty,
                parameters=times,
            )
        },
        "episodes": {
            "get": _operation(
                "list_episodes",
                "List the episodes, and the one that runs.",
                _json_response("The lists.", _OBJECT),
                none,
            ),
            "post": _operation(
                "change_episodes",
                "Start, end, judge or change an episode.",
                _json_response("The episode.", _OBJECT),
                {422: "The request is invalid.", **NOT_NOW, **none},
                requestBody=_body("application/json", _OBJECT),
            ),
        },
        "episodes/{number}": {
            "get": _operation(
                "download_episode", "Download an episode.", file, none, parameters=[number]
            )
        },
    }


def _document(operation: str, about: str, media: str) -> dict[str, Any]:
    responses = {"200": _content("The document.", media)}
    return {"get": {"operationId": operation, "summary": about, "responses": responses}}


_OBJECT = {"type": "object"}


def _body(media: str, schema: Any) -> dict[str, Any]:
    return {"required": True, "content": {media: {"schema": schema}}}


def _reference(kind: type) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{kind.__name__}"}


def _response(description: str, kind: type) -> dict[str, Any]:
    return _json_response(description, _reference(kind))


def _json_response(description: str, schema: Any) -> dict[str, Any]:
    return {"description": description, "content": {"application/json": {"schema": schema}}}


def _content(description: str, media: str) -> dict[str, Any]:
    """Describe a response that is a text or a file of type ``media``."""
    return {"description": description, "content": {media: {"schema": {"type": "string"}}}}


def _query(name: str, about: str, **schema: Any) -> dict[str, Any]:
    return _parameter(name, about, "query", **schema)


def _parameter(name: str, about: str, place: str, **schema: Any) -> dict[str, Any]:
    """Describe a parameter at ``place``: in the path, the query or the header."""
    described = {"description": about} if about else {}
    required = {"required": place == "path"} if place != "header" else {}
    schema = {"type": "string", **schema}
    return {"name": name, "in": place, "schema": schema, **required, **described}


def description_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the route of the OpenAPI document, which everybody may read.

    It describes the paths and requests of this server, also those of its extensions.
    """
    hub = context.hub

    async def openapi(request: HttpRequest) -> Response:
        present = frozenset(getattr(route, "path", "") for route in request.app.routes)
        return Response(openapi_json(hub.requests.kinds, present), media_type="application/json")

    return [Route(f"{ROOT}/openapi.json", openapi)]
