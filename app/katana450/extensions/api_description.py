"""Description of the API for programs: an OpenAPI 3.1 document, from the message classes."""

from __future__ import annotations

import functools
import inspect
import re
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
        "mesh": {"post": _mesh()},
        "scene": {"get": _scene_download(), "post": _scene_upload()},
        **_scripts(),
        **_recordings(),
        **_documents(),
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


def _question(path: str, kind: type) -> dict[str, Any]:
    return {
        "operationId": f"get_{path}",
        "summary": summary(kind),
        "responses": {
            "200": _response("The present value.", kind),
            "409": _response("There is no such value.", answers.Refused),
            **COMMON_RESPONSES,
            **NOT_READY,
        },
    }


def _stop() -> dict[str, Any]:
    return {
        "operationId": "stop",
        "summary": summary(requests.Stop),
        "parameters": [
            _query(
                "press",
                "Name of this press. The same name again does not count again.",
                maxLength=MAX_PRESS_LENGTH,
            )
        ],
        "responses": {"204": {"description": "The stop is requested."}, **COMMON_RESPONSES},
    }


def _do(request: Any, answer: Any) -> dict[str, Any]:
    """Describe the path of single requests, by the schemas of requests and answers."""
    return {
        "operationId": "do",
        "summary": "Execute one request.",
        "description": "A request with `wait` is answered when its motion has ended; the open "
        "connection then counts as the heartbeat. After any other motion request the program sends "
        "ten requests a second until the arm rests, or the arm stops or pauses.",
        "parameters": [
            {
                "name": "X-Program",
                "in": "header",
                "required": True,
                "schema": {"type": "string", "pattern": "^[A-Za-z0-9_-]{16,64}$"},
                "description": "A secret key that identifies the program; others never see it.",
            },
            {
                "name": "X-Name",
                "in": "header",
                "schema": {"type": "string", "maxLength": 40},
                "description": "The name of the program that others see.",
            },
        ],
        "requestBody": {"required": True, "content": {"application/json": {"schema": request}}},
        "responses": {
            "200": _json_response("The request is done, or its answer.", answer),
            "409": _json_response(
                "The request is refused at present, or its motion did not reach its end.",
                {"anyOf": [_reference(answers.Refused), _reference(answers.Done)]},
            ),
            "422": _response("The request is invalid.", answers.Refused),
            "408": _response("The body was not received in time.", answers.Refused),
            "413": _response("The body is too large.", answers.Refused),
            **COMMON_RESPONSES,
        },
    }


def _mesh() -> dict[str, Any]:
    return {
        "operationId": "upload_mesh",
        "summary": "Upload a mesh, which `place` then uses by its key.",
        "parameters": [
            _query("name", "The file's name, with its ending.", required=True),
            _query(
                "format",
                "wrl, stl, obj, ply, off, glb, gltf, dae, 3mf or zip, for a name "
                "without an ending. A zip holds one such file and the files that it names.",
            ),
            _query("main", "Path in a zip of the file to read, if there are several."),
            _query("unit", "mm, cm, in or m. Without it the unit is guessed and reported."),
        ],
        **_upload("application/octet-stream", answers.Mesh),
    }


def _scene_upload() -> dict[str, Any]:
    return {
        "operationId": "upload_scene",
        "summary": "Upload a scene, which `load` then uses by its key.",
        **_upload("application/zip", answers.Scene),
    }


def _scene_download() -> dict[str, Any]:
    return {
        "operationId": "download_scene",
        "summary": "Download the scene as a .zip of scene.yaml and its meshes.",
        "responses": {
            "200": _content("The present scene.", "application/zip"),
            "409": _response("The request is refused at present.", answers.Refused),
            **COMMON_RESPONSES,
        },
    }


def _scripts() -> dict[str, Any]:
    """Describe the paths of scripts, by path."""
    name = {"name": "name", "in": "path", "required": True, "schema": {"type": "string"}}
    text = {"required": True, "content": {"text/plain": {"schema": {"type": "string"}}}}
    return {
        "scripts": {
            "get": {
                "operationId": "list_scripts",
                "summary": "List the names of the scripts.",
                "responses": {
                    "200": _json_response("The names, and whether texts can be saved.", _OBJECT),
                    **COMMON_RESPONSES,
                },
            },
            "post": {
                "operationId": "check_script",
                "summary": "List the problems of a script by line. Nothing is planned.",
                "requestBody": text,
                "responses": {
                    "200": _json_response("The problems, and the taught poses.", _OBJECT),
                    **COMMON_RESPONSES,
                },
            },
        },
        "scripts/{name}": {
            "get": {
                "operationId": "get_script",
                "summary": "Return the text of a script.",
                "parameters": [name],
                "responses": {
                    "200": _content("The text.", "text/plain"),
                    "404": _response("There is no script of this name.", answers.Refused),
                    **COMMON_RESPONSES,
                },
            },
            "post": {
                "operationId": "save_script",
                "summary": "Save a valid script under a new name in the folder of `--programs`.",
                "parameters": [name],
                "requestBody": text,
                "responses": {
                    "204": {"description": "The script is saved."},
                    "409": _response("It cannot be saved, and why.", answers.Refused),
                    "422": _response("It is not a valid script, and why.", answers.Refused),
                    **COMMON_RESPONSES,
                },
            },
        },
        "script.schema.json": _document(
            "get_script_schema", "Return the JSON Schema of scripts.", "application/schema+json"
        ),
    }


def _recordings() -> dict[str, Any]:
    """Describe the paths of recordings and episodes, by path."""
    times = [
        _query("last", "Time before the present [s].", type="number"),
        _query("from", "Begin [s since the epoch].", type="number"),
        _query("to", "End [s since the epoch].", type="number"),
    ]
    number = {"name": "number", "in": "path", "required": True, "schema": {"type": "integer"}}
    json = {"required": True, "content": {"application/json": {"schema": _OBJECT}}}
    common = {
        "404": _response("There is no such recording here.", answers.Refused),
        **COMMON_RESPONSES,
    }
    responses = {"409": _response("Nothing was recorded, and why.", answers.Refused), **common}
    return {
        "recording": {
            "get": {
                "operationId": "download_recording",
                "summary": "Download what was recorded, at most ten minutes of motion.",
                "parameters": times,
                "responses": {
                    "200": _content("An MCAP file.", "application/octet-stream"),
                    **responses,
                },
            }
        },
        "recording/script": {
            "get": {
                "operationId": "download_recording_script",
                "summary": "Download a script that runs the recorded motion again.",
                "parameters": times,
                "responses": {"200": _content("The script.", "application/yaml"), **responses},
            }
        },
        "episodes": {
            "get": {
                "operationId": "list_episodes",
                "summary": "List the episodes, and the one that runs.",
                "responses": {"200": _json_response("The lists.", _OBJECT), **common},
            },
            "post": {
                "operationId": "change_episodes",
                "summary": "Start, end, judge or change an episode.",
                "requestBody": json,
                "responses": {
                    "200": _json_response("The episode.", _OBJECT),
                    "409": _response("The request is refused at present.", answers.Refused),
                    "422": _response("The request is invalid.", answers.Refused),
                    **common,
                },
            },
        },
        "episodes/{number}": {
            "get": {
                "operationId": "download_episode",
                "summary": "Download an episode.",
                "parameters": [number],
                "responses": {
                    "200": _content("An MCAP file.", "application/octet-stream"),
                    **common,
                },
            }
        },
    }


def _documents() -> dict[str, Any]:
    """Describe the paths of the documents about the API, by path."""
    return {
        "openapi.json": _document("get_openapi", "Return this document.", "application/json"),
    }


def _document(operation: str, about: str, media: str) -> dict[str, Any]:
    responses = {"200": _content("The document.", media)}
    return {"get": {"operationId": operation, "summary": about, "responses": responses}}


def _upload(media: str, answer: type) -> dict[str, Any]:
    """Describe an upload of type ``media`` that is answered with ``kept``."""
    return {
        "requestBody": {
            "required": True,
            "content": {media: {"schema": {"type": "string", "format": "binary"}}},
        },
        "responses": {
            "200": _response("The file is kept.", answer),
            "422": _response("The file cannot be read.", answers.Refused),
            "413": _response("The file is too large.", answers.Refused),
            **COMMON_RESPONSES,
            **NOT_READY,
        },
    }


_OBJECT = {"type": "object"}


def _reference(kind: type) -> dict[str, str]:
    return {"$ref": f"#/components/schemas/{kind.__name__}"}


def _response(description: str, kind: type) -> dict[str, Any]:
    return _json_response(description, _reference(kind))


def _json_response(description: str, schema: Any) -> dict[str, Any]:
    return {"description": description, "content": {"application/json": {"schema": schema}}}


def _content(description: str, media: str) -> dict[str, Any]:
    """Describe a response that is a text or a file of type ``media``."""
    return {"description": description, "content": {media: {"schema": {"type": "string"}}}}


def _query(
    name: str, description: str, *, required: bool = False, type: str = "string", **schema: Any
) -> dict[str, Any]:
    return {
        "name": name,
        "in": "query",
        "required": required,
        "schema": {"type": type, **schema},
        "description": description,
    }


COMMON_RESPONSES = {
    "401": _response("A token is required.", answers.Refused),
    "403": _response("The sender may not do this.", answers.Refused),
    "429": _response(
        "Too many requests, or too costly ones. `Retry-After` says when.", answers.Refused
    ),
}
"""Responses of every path but the documents."""

NOT_READY = {"503": _response("The arm is not ready yet.", answers.Refused)}


def description_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the route of the OpenAPI document, which everybody may read.

    It describes the paths and requests of this server, also those of its extensions.
    """
    hub = context.hub

    async def openapi(request: HttpRequest) -> Response:
        present = frozenset(getattr(route, "path", "") for route in request.app.routes)
        return Response(openapi_json(hub.requests.kinds, present), media_type="application/json")

    return [Route(f"{ROOT}/openapi.json", openapi)]
