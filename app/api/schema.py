"""The API described: as OpenAPI for tools, and as a page for people. Both from the shapes alone."""

from __future__ import annotations

import functools
import inspect
from typing import Any, get_args

import msgspec

from app.api import answers, requests
from app.api.fields import ROOT

TITLE = "katana450"

READABLE = {
    "state": answers.State,
    "arm": answers.Arm,
    "ledger": answers.Ledger,
    "branches": answers.Branches,
    "loop": answers.Loop,
    "things": answers.Things,
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
def openapi_json() -> bytes:
    """OpenAPI 3.1, as JSON."""
    shapes = [requests.AnyRequest, answers.AnyAnswer]
    (request, answer), components = msgspec.json.schema_components(
        shapes, ref_template="#/components/schemas/{name}"
    )

    def told(what: str, schema: Any) -> dict[str, Any]:
        return {"description": what, "content": {"application/json": {"schema": schema}}}

    refused = {
        "401": {"description": "A token is asked for."},
        "503": {"description": "The arm is not there yet."},
    }
    paths: dict[str, Any] = {
        f"{ROOT}/{path}": {
            "get": {
                "summary": summary(kind),
                "responses": {
                    "200": told("Now.", {"$ref": f"#/components/schemas/{kind.__name__}"}),
                    **refused,
                },
            }
        }
        for path, kind in READABLE.items()
    }
    paths[f"{ROOT}/stop"] = {
        "post": {
            "summary": summary(requests.Stop),
            "responses": {"204": {"description": "The arm comes to rest."}, **refused},
        }
    }
    paths[f"{ROOT}/do"] = {
        "post": {
            "summary": "Do one request; whoever holds the arm keeps asking, ten times a second.",
            "parameters": [
                {
                    "name": "X-Program",
                    "in": "header",
                    "required": True,
                    "schema": {"type": "string", "pattern": "^[A-Za-z0-9_-]{8,64}$"},
                    "description": "Tells programs apart; who knows it speaks for the program.",
                }
            ],
            "requestBody": {
                "required": True,
                "content": {"application/json": {"schema": request}},
            },
            "responses": {
                "200": told("Done, or what was asked for.", answer),
                "409": told("Not now.", {"$ref": "#/components/schemas/Refused"}),
                "422": told("Not understood.", {"$ref": "#/components/schemas/Refused"}),
                **refused,
            },
        }
    }
    too_much = {
        "413": {"description": "It is too long."},
        "429": told("Too many at once.", {"$ref": "#/components/schemas/Refused"}),
    }
    paths[f"{ROOT}/mesh"] = {
        "post": {
            "summary": "Bring a mesh, to be placed by its key.",
            "parameters": [
                _query("name", "The file's name, with its ending.", required=True),
                _query("format", "wrl, stl, obj, ply, glb or gltf, where the name has no ending."),
                _query("unit", "mm, cm, in or m; without it that is guessed, and said."),
            ],
            "requestBody": _file("application/octet-stream"),
            "responses": {
                "200": told("It is kept.", {"$ref": "#/components/schemas/Mesh"}),
                "422": told("It cannot be read.", {"$ref": "#/components/schemas/Refused"}),
                **too_much,
                **refused,
            },
        }
    }
    paths[f"{ROOT}/scene"] = {
        "get": {
            "summary": "What stands around, as a .zip of scene.yaml and its meshes.",
            "responses": {
                "200": {
                    "description": "Now.",
                    "content": {"application/zip": {"schema": {"type": "string"}}},
                },
                "409": told("Not now.", {"$ref": "#/components/schemas/Refused"}),
                **refused,
            },
        },
        "post": {
            "summary": "Bring a scene, to be loaded by its key.",
            "requestBody": _file("application/zip"),
            "responses": {
                "200": told("It is kept.", {"$ref": "#/components/schemas/Scene"}),
                "422": told("It cannot be read.", {"$ref": "#/components/schemas/Refused"}),
                **too_much,
                **refused,
            },
        },
    }
    described = {
        "openapi": "3.1.0",
        "info": {"title": TITLE, "version": str(requests.VERSION)},
        "security": [{}, {"link": []}],
        "paths": paths,
        "components": {
            "schemas": components,
            "securitySchemes": {"link": {"type": "http", "scheme": "bearer"}},
        },
    }
    return msgspec.json.encode(described)


def _query(name: str, said: str, *, required: bool = False) -> dict[str, Any]:
    return {
        "name": name,
        "in": "query",
        "required": required,
        "schema": {"type": "string"},
        "description": said,
    }


def _file(kind: str) -> dict[str, Any]:
    content = {kind: {"schema": {"type": "string", "format": "binary"}}}
    return {"required": True, "content": content}
