"""Description of the API for programs: an OpenAPI 3.1 document, from the message classes.

It describes requests and answers; docs/api.md has the paths of files and lists.
"""

from __future__ import annotations

import functools
import inspect
import re
from typing import Any, Union

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


JSON = "application/json"

TEXT = {"type": "string"}

ANSWERS = {tag_of(kind.__name__): kind for kind in answers.EVERY}
"""Class of each answer by its name."""

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


def _operation(name: str, about: str, answer: Any = None) -> dict[str, Any]:
    """Describe an operation by its name, one line of text, and the schema of its answer, if any."""
    refused = _content(_reference(answers.Refused))
    responses: dict[str, Any] = {
        "204": {"description": "Done."},
        **{status: {"description": why, **refused} for status, why in REFUSALS.items()},
    }
    if answer is not None:
        responses["200"] = responses.pop("204") | _content(answer)
    return {"operationId": name, "summary": about, "responses": responses}


def _do(request: Any, answer: Any) -> dict[str, Any]:
    """Describe the path of single requests, by the schemas of requests and answers."""
    described = _operation("do", "Execute one request.", answer)
    either = {"anyOf": [_reference(answers.Refused), _reference(answers.Done)]}
    described["responses"]["409"] = {
        "description": "Refused at present, or its motion did not reach its end.",
        **_content(either),
    }
    key = "A secret key that identifies the program; others never see it."
    shown = "The name of the program that others see."
    return {
        **described,
        "description": "A request with `wait` is answered when its motion has ended; the open "
        "connection then counts as the heartbeat. After any other motion request the program sends "
        "ten requests a second until the arm rests, or the arm stops or pauses.",
        "parameters": [
            _parameter("X-Program", "header", key, pattern="^[A-Za-z0-9_-]{16,64}$")
            | {"required": True},
            _parameter("X-Name", "header", shown, maxLength=40),
        ],
        "requestBody": _content(request),
    }


def _content(schema: Any) -> dict[str, Any]:
    return {"content": {JSON: {"schema": schema}}}


def _reference(kind: type) -> dict[str, str]:
    return {"$ref": REFERENCE.format(name=kind.__name__)}


def _parameter(name: str, place: str, about: str, **schema: Any) -> dict[str, Any]:
    """Describe a parameter at ``place``: in the query or the header."""
    return {"name": name, "in": place, "schema": TEXT | schema, "description": about}


@functools.cache
def openapi_json(kinds: tuple[type[Request], ...]) -> bytes:
    """Return the document as JSON. ``kinds``: the requests of the server."""
    request, answer, components = schemas(kinds)
    stop = _operation("stop", summary(requests.Stop))
    about = "Name of this press. The same name again does not count again."
    stop["parameters"] = [_parameter("press", "query", about, maxLength=MAX_PRESS_LENGTH)]
    paths = {f"{ROOT}/do": {"post": _do(request, answer)}, f"{ROOT}/stop": {"post": stop}}
    for subject in QUERY_SUBJECTS:
        kind = ANSWERS[subject]
        query = _operation(f"get_{subject}", summary(kind), _reference(kind))
        paths[f"{ROOT}/{subject}"] = {"get": query}
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
        "paths": paths,
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


def description_routes(context: RouteContext) -> list[BaseRoute]:
    """Return the route of the OpenAPI document, which everybody may read.

    It describes the requests of this server, also those of its extensions.
    """
    hub = context.hub

    async def openapi(_request: HttpRequest) -> Response:
        return Response(openapi_json(hub.requests.kinds), media_type=JSON)

    return [Route(f"{ROOT}/openapi.json", openapi)]
