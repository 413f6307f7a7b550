"""Description of the API from the message classes: OpenAPI for tools, and the page docs/api.md."""

from __future__ import annotations

import functools
import inspect
from typing import Any, Union, get_args

import msgspec

from katana450.server.api import answers, requests
from katana450.server.api.fields import ROOT, Request

TITLE = "katana450"

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


def kinds(union: Any) -> tuple[type[msgspec.Struct], ...]:
    """Return the message classes of a union, in order."""
    return get_args(union)


def summary(kind: type) -> str:
    """Return the first line of the docstring of ``kind``."""
    return (inspect.getdoc(kind) or "").partition("\n")[0]


@functools.cache
def openapi_json(added: tuple[type[Request], ...] = ()) -> bytes:
    """Return the OpenAPI 3.1 description as JSON. ``added``: requests of an extension."""
    every: Any = Union[(requests.AnyRequest, *added)]
    shapes = [every, answers.AnyAnswer]
    (request, answer), components = msgspec.json.schema_components(
        shapes, ref_template="#/components/schemas/{name}"
    )
    paths: dict[str, Any] = {
        path: {
            "get": {
                "summary": summary(kind),
                "responses": {"200": _response("The present value.", kind), **COMMON_RESPONSES},
            }
        }
        for path, kind in READABLE.items()
    }
    paths["stop"] = {
        "post": {
            "summary": summary(requests.Stop),
            "responses": {"204": {"description": "The stop is requested."}, **COMMON_RESPONSES},
        }
    }
    paths["do"] = {"post": _do(request, answer)}
    paths["mesh"] = {"post": _mesh()}
    paths["scene"] = {"get": _scene_download(), "post": _scene_upload()}
    described = {
        "openapi": "3.1.0",
        "info": {"title": TITLE, "version": str(requests.VERSION)},
        "security": [{}, {"link": []}],
        "paths": {f"{ROOT}/{path}": operations for path, operations in paths.items()},
        "components": {
            "schemas": components,
            "securitySchemes": {"link": {"type": "http", "scheme": "bearer"}},
        },
    }
    return msgspec.json.encode(described)


COMMON_RESPONSES = {
    "401": {"description": "A token is required."},
    "503": {"description": "The arm is not ready yet."},
}
"""Responses of every path."""


def _do(request: Any, answer: Any) -> dict[str, Any]:
    """Describe the path of single requests, by the schemas of requests and answers."""
    return {
        "summary": "Execute one request. The holder of the lease sends ten a second.",
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
            "409": _response("The request is refused at present.", answers.Refused),
            "422": _response("The request is invalid.", answers.Refused),
            **COMMON_RESPONSES,
        },
    }


def _mesh() -> dict[str, Any]:
    return {
        "summary": "Upload a mesh, which `place` then uses by its key.",
        "parameters": [
            _query("name", "The file's name, with its ending.", required=True),
            _query(
                "format",
                "wrl, stl, obj, ply, off, glb, gltf, dae or 3mf, for a name without an ending.",
            ),
            _query("unit", "mm, cm, in or m. Without it the unit is guessed and reported."),
        ],
        **_upload("application/octet-stream", answers.Mesh),
    }


def _scene_upload() -> dict[str, Any]:
    return {
        "summary": "Upload a scene, which `load` then uses by its key.",
        **_upload("application/zip", answers.Scene),
    }


def _scene_download() -> dict[str, Any]:
    return {
        "summary": "Download the scene as a .zip of scene.yaml and its meshes.",
        "responses": {
            "200": {
                "description": "The present scene.",
                "content": {"application/zip": {"schema": {"type": "string"}}},
            },
            "409": _response("The request is refused at present.", answers.Refused),
            **COMMON_RESPONSES,
        },
    }


def _upload(media: str, kept: type) -> dict[str, Any]:
    """Describe an upload of type ``media`` that is answered with ``kept``."""
    return {
        "requestBody": {
            "required": True,
            "content": {media: {"schema": {"type": "string", "format": "binary"}}},
        },
        "responses": {
            "200": _response("The file is kept.", kept),
            "422": _response("The file cannot be read.", answers.Refused),
            "413": {"description": "The file is too large."},
            "429": _response("Too many files are being uploaded.", answers.Refused),
            **COMMON_RESPONSES,
        },
    }


def _response(description: str, kind: type) -> dict[str, Any]:
    return _json_response(description, {"$ref": f"#/components/schemas/{kind.__name__}"})


def _json_response(description: str, schema: Any) -> dict[str, Any]:
    return {"description": description, "content": {"application/json": {"schema": schema}}}


def _query(name: str, description: str, *, required: bool = False) -> dict[str, Any]:
    return {
        "name": name,
        "in": "query",
        "required": required,
        "schema": {"type": "string"},
        "description": description,
    }
