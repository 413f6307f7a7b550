"""The AsyncAPI 3.0 document: the API on the websocket and on the TCP port.

It is written as the server sees it: the server receives requests and sends answers.
"""

from __future__ import annotations

import functools
from typing import Any

import msgspec

from katana450.extensions.api_description.messages import (
    ABOUT,
    LICENSE,
    TITLE,
    documentation,
    kinds,
    schemas,
    summary,
)
from katana450.extensions.api_description.openapi import READABLE
from katana450.server.api import answers, requests
from katana450.server.api.fields import MAX_REQUEST_BYTES, ROOT, Request, tag_of

SOCKET, LINES = "socket", "lines"
"""Names of the websocket and the TCP port in the document."""

ANSWERS: dict[type, tuple[type, ...]] = {
    requests.Hello: (answers.Welcome,),
    requests.Heartbeat: (answers.Echo,),
    requests.Get: (answers.Values,),
    requests.ListPeople: (answers.People,),
    requests.Query: tuple(READABLE.values()),
}
"""Answers to requests that are not answered with ``done``. Each can be answered ``refused``."""


def asyncapi_json(asked: tuple[type[Request], ...], host: str, *, secure: bool) -> bytes:
    """Return the document as JSON.

    ``asked``: the requests of the server. ``host``: its host and port. ``secure``: whether it uses
    TLS.
    """
    servers = {
        SOCKET: {
            "host": host,
            "protocol": "wss" if secure else "ws",
            "description": "The websocket. A server with access links requires a token.",
            "security": [{"$ref": "#/components/securitySchemes/link"}],
        },
        LINES: {
            "host": "127.0.0.1:{port}",
            "protocol": "tcp",
            "description": "JSON lines for programs on the same machine, `serve --lines PORT`. The "
            "token of an access link is a field of `hello`.",
            "variables": {"port": {"default": "5560", "description": "The port of `--lines`."}},
        },
    }
    document = {"asyncapi": "3.0.0", "servers": servers, **_parts(asked)}
    return msgspec.json.encode(document)


@functools.cache
def _parts(asked: tuple[type[Request], ...]) -> dict[str, msgspec.Raw]:
    """Return the parts of the document that are the same on every address, as JSON."""
    _, _, components = schemas(asked)
    answered = kinds(answers.AnyAnswer)
    parts = {
        "info": {
            "title": TITLE,
            "version": str(requests.VERSION),
            "description": ABOUT,
            "license": {"name": LICENSE["name"]},
        },
        "defaultContentType": "application/json",
        "channels": {
            SOCKET: {
                "address": f"{ROOT}/socket",
                "summary": "One request or answer per text message.",
                "servers": [{"$ref": f"#/servers/{SOCKET}"}],
                "messages": _messages(each for each in (*asked, *answered) if _on(SOCKET, each)),
                "bindings": {"ws": _WEBSOCKET},
            },
            LINES: {
                "address": None,
                "summary": "One request or answer per line, which ends with a line feed. The first "
                f"line is a `hello`. A request has at most {MAX_REQUEST_BYTES} bytes.",
                "servers": [{"$ref": f"#/servers/{LINES}"}],
                "messages": _messages((*asked, *answered)),
            },
        },
        "operations": {
            f"{channel}_{name}": operation
            for channel in (SOCKET, LINES)
            for name, operation in _operations(channel, asked)
        },
        "components": {
            "schemas": {name: _draft_7(schema) for name, schema in components.items()},
            "messages": {kind.__name__: _message(kind) for kind in (*asked, *answered)},
            "correlationIds": {
                "id": {
                    "description": "An answer repeats the `id` of its request.",
                    "location": "$message.payload#/id",
                }
            },
            "securitySchemes": {
                "link": {
                    "type": "http",
                    "scheme": "bearer",
                    "description": "Token of an access link, the part after its `#`.",
                }
            },
        },
    }
    return {name: msgspec.Raw(msgspec.json.encode(part)) for name, part in parts.items()}


_WEBSOCKET = {
    "query": {
        "type": "object",
        "properties": {
            "name": {
                "type": "string",
                "maxLength": 40,
                "description": "Name of the program that others see.",
            }
        },
    },
    "bindingVersion": "0.1.0",
}


def _on(channel: str, kind: type) -> bool:
    """Return whether messages of ``kind`` are sent on ``channel``: a websocket needs no hello."""
    return channel == LINES or kind is not requests.Hello


def _messages(every: Any) -> dict[str, Any]:
    return {kind.__name__: {"$ref": f"#/components/messages/{kind.__name__}"} for kind in every}


def _message(kind: type) -> dict[str, Any]:
    return {
        "name": tag_of(kind.__name__),
        "title": kind.__name__,
        "summary": summary(kind),
        "description": documentation(kind)[0],
        "correlationId": {"$ref": "#/components/correlationIds/id"},
        "payload": {"$ref": f"#/components/schemas/{kind.__name__}"},
    }


def _operations(channel: str, asked: tuple[type, ...]) -> list[tuple[str, dict[str, Any]]]:
    """Return the operations on ``channel`` with their names: each request, and what is sent."""
    place = f"#/channels/{channel}"

    def references(*every: type) -> list[dict[str, str]]:
        return [{"$ref": f"{place}/messages/{each.__name__}"} for each in every]

    received = [
        (
            tag_of(kind.__name__),
            {
                "action": "receive",
                "channel": {"$ref": place},
                "summary": summary(kind),
                "messages": references(kind),
                "reply": {
                    "channel": {"$ref": place},
                    "messages": references(*ANSWERS.get(kind, (answers.Done,)), answers.Refused),
                },
            },
        )
        for kind in asked
        if _on(channel, kind)
    ]
    sent = {
        "action": "send",
        "channel": {"$ref": place},
        "summary": "Greet the program, then send states as `watch` asks, and refusals.",
        "messages": references(answers.Welcome, answers.State, answers.Refused),
    }
    return [*received, ("unasked", sent)]


def _draft_7(schema: Any) -> Any:
    """Return ``schema`` in the words of draft 7 of JSON Schema, which AsyncAPI uses."""
    if isinstance(schema, list):
        return [_draft_7(each) for each in schema]
    if not isinstance(schema, dict):
        return schema
    found = {name: _draft_7(value) for name, value in schema.items()}
    if "prefixItems" in found:
        found["additionalItems"] = found.get("items", True)
        found["items"] = found.pop("prefixItems")
    return found
