"""The API described from the shapes alone: as OpenAPI for tools, and for the page of docs/api."""

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
    """The shapes of a union, in order."""
    return get_args(union)


def summary(kind: type) -> str:
    """The first line of what is said of ``kind``."""
    return (inspect.getdoc(kind) or "").partition("\n")[0]


@functools.cache
def openapi_json(added: tuple[type[Request], ...] = ()) -> bytes:
    """OpenAPI 3.1, as JSON. ``added``: requests of an extension."""
    every: Any = Union[(requests.AnyRequest, *added)]
    shapes = [every, answers.AnyAnswer]
    (request, answer), components = msgspec.json.schema_components(
        shapes, ref_template="#/components/schemas/{name}"
    )
    paths: dict[str, Any] = {
        path: {"get": {"summary": summary(kind), "responses": {"200": _told("Now.", kind), **DOOR}}}
        for path, kind in READABLE.items()
    }
    paths["stop"] = {
        "post": {
            "summary": summary(requests.Stop),
            "responses": {"204": {"description": "The arm comes to rest."}, **DOOR},
        }
    }
    paths["do"] = {"post": _do(request, answer)}
    paths["mesh"] = {"post": _mesh()}
    paths["scene"] = {"get": _scene_out(), "post": _scene_in()}
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


DOOR = {
    "401": {"description": "A token is asked for."},
    "503": {"description": "The arm is not there yet."},
}
"""Answers of every path."""


def _do(request: Any, answer: Any) -> dict[str, Any]:
    """Of single requests, by their shapes and those of their answers."""
    return {
        "summary": "Do one request; whoever holds the arm keeps asking, ten times a second.",
        "parameters": [
            {
                "name": "X-Program",
                "in": "header",
                "required": True,
                "schema": {"type": "string", "pattern": "^[A-Za-z0-9_-]{16,64}$"},
                "description": "A secret key that tells programs apart; nobody else is shown it.",
            },
            {
                "name": "X-Name",
                "in": "header",
                "schema": {"type": "string", "maxLength": 40},
                "description": "The name of the program that others see.",
            },
        ],
        "requestBody": {
            "required": True,
            "content": {"application/json": {"schema": request}},
        },
        "responses": {
            "200": _shaped("Done, or what was asked for.", answer),
            "409": _told("Not now.", answers.Refused),
            "422": _told("Not understood.", answers.Refused),
            **DOOR,
        },
    }


def _mesh() -> dict[str, Any]:
    return {
        "summary": "Bring a mesh, to be placed by its key.",
        "parameters": [
            _query("name", "The file's name, with its ending.", required=True),
            _query(
                "format",
                "wrl, stl, obj, ply, off, glb, gltf, dae or 3mf, where the name has no ending.",
            ),
            _query("unit", "mm, cm, in or m; without it that is guessed, and said."),
        ],
        **_brought("application/octet-stream", answers.Mesh),
    }


def _scene_in() -> dict[str, Any]:
    return {
        "summary": "Bring a scene, to be loaded by its key.",
        **_brought("application/zip", answers.Scene),
    }


def _scene_out() -> dict[str, Any]:
    return {
        "summary": "What stands around, as a .zip of scene.yaml and its meshes.",
        "responses": {
            "200": {
                "description": "Now.",
                "content": {"application/zip": {"schema": {"type": "string"}}},
            },
            "409": _told("Not now.", answers.Refused),
            **DOOR,
        },
    }


def _brought(media: str, kept: type) -> dict[str, Any]:
    """Of a file that is sent, and answered as ``kept``."""
    return {
        "requestBody": {
            "required": True,
            "content": {media: {"schema": {"type": "string", "format": "binary"}}},
        },
        "responses": {
            "200": _told("It is kept.", kept),
            "422": _told("It cannot be read.", answers.Refused),
            "413": {"description": "It is too long."},
            "429": _told("Too many at once.", answers.Refused),
            **DOOR,
        },
    }


def _told(what: str, kind: type) -> dict[str, Any]:
    return _shaped(what, {"$ref": f"#/components/schemas/{kind.__name__}"})


def _shaped(what: str, schema: Any) -> dict[str, Any]:
    return {"description": what, "content": {"application/json": {"schema": schema}}}


def _query(name: str, said: str, *, required: bool = False) -> dict[str, Any]:
    return {
        "name": name,
        "in": "query",
        "required": required,
        "schema": {"type": "string"},
        "description": said,
    }
