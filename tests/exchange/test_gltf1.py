"""Test glTF 1.0: named parts, strides in accessors, several meshes of a node, binary files."""

from __future__ import annotations

import base64
import json
import struct
from typing import Any

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.importers.shape_file import Format, ShapeFile, read_shape
from tests.exchange.solids import sides

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")
ROWS = np.column_stack((CORNERS, np.zeros((4, 3), "<f4"))).astype("<f4")
"""Corners with normals between them, as in a file with a stride."""
INDEX = np.array([0, 1, 2, 0, 2, 3], "<u2")
DATA = ROWS.tobytes() + INDEX.tobytes()


def document(**parts: Any) -> dict[str, Any]:
    """Return two squares of 2 m × 1 m, red and blue, above each other."""
    primitive = {"attributes": {"POSITION": "corners"}, "indices": "index", "mode": 4}
    return {
        "asset": {"version": "1.0"},
        "scene": "room",
        "scenes": {"room": {"nodes": ["root"]}},
        "nodes": {
            "root": {"children": ["low", "high"], "scale": [2, 1, 1]},
            "low": {"meshes": ["red"], "matrix": np.eye(4).ravel().tolist()},
            "high": {"meshes": ["red", "blue"], "translation": [0, 0, 0.5]},
        },
        "meshes": {
            "red": {"primitives": [primitive | {"material": "red"}]},
            "blue": {"primitives": [primitive | {"material": "blue"}]},
        },
        "materials": {
            "red": {"technique": "t", "values": {"diffuse": [1, 0, 0, 1]}},
            "blue": {
                "extensions": {
                    "KHR_materials_common": {"values": {"diffuse": [0, 0, 0.5, 1]}},
                }
            },
        },
        "accessors": {
            "corners": {
                "bufferView": "all",
                "byteOffset": 0,
                "byteStride": 24,
                "componentType": 5126,
                "count": 4,
                "type": "VEC3",
            },
            "index": {
                "bufferView": "rest",
                "byteOffset": 0,
                "componentType": 5123,
                "count": 6,
                "type": "SCALAR",
            },
        },
        "bufferViews": {
            "all": {"buffer": "b", "byteOffset": 0, "byteLength": 96},
            "rest": {"buffer": "b", "byteOffset": 96, "byteLength": 12},
        },
        "buffers": {"b": {"byteLength": len(DATA), "uri": "data:," + _quoted(DATA)}},
    } | parts


def _quoted(data: bytes) -> str:
    return "".join(f"%{byte:02x}" for byte in data)


def read(parts: dict[str, Any]) -> ShapeFile:
    return read_shape(json.dumps(parts).encode(), Format.GLTF, "a.gltf")


def binary(parts: dict[str, Any], data: bytes = DATA, name: str = "binary_glTF") -> bytes:
    """Return a binary file whose buffer is called ``name``, after another buffer."""
    other = {"byteLength": 1, "uri": "data:;base64," + base64.b64encode(b"x").decode()}
    views = {key: each | {"buffer": name} for key, each in parts["bufferViews"].items()}
    body = {"byteLength": len(data), "uri": "data:,"}
    content = parts | {"bufferViews": views, "buffers": {"a": other, name: body}}
    text = json.dumps(content).encode()
    head = struct.pack("<4sIIII", b"glTF", 1, 20 + len(text) + len(data), len(text), 0)
    return head + text + data


def colours(shape: ShapeFile) -> set[tuple[int, ...]]:
    assert shape.colours is not None
    return {tuple(row) for row in shape.colours.tolist()}


def test_the_scene_is_read_with_its_places_and_colours() -> None:
    shape = read(document())
    assert len(shape.faces) == 3 * 2
    assert sides(shape) == pytest.approx([2e3, 500.0, 1e3])
    assert colours(shape) == {(255, 0, 0, 255), (0, 0, 128, 255)}


@pytest.mark.parametrize("name", ["binary_glTF", "KHR_binary_glTF"])
def test_a_binary_file_is_read(name: str) -> None:
    shape = read_shape(binary(document(), name=name), Format.GLB, "a.glb")
    assert len(shape.faces) == 3 * 2


def test_a_document_without_a_version_is_known_by_its_names() -> None:
    parts = document()
    for asset in ({}, {"asset": {"version": 1}}):
        without = {key: each for key, each in parts.items() if key != "asset"} | asset
        assert len(read(without).faces) == 6


def test_a_picture_and_bones_are_reported() -> None:
    parts = document()
    parts["materials"]["red"]["values"]["diffuse"] = "picture"
    parts["nodes"]["low"]["skin"] = "bones"
    parts["animations"] = {"walk": {}}
    text = read(parts).text
    for what in ("pictures on the surface", "bones", "motion"):
        assert what in text


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"scene": "gone"}, "it refers to 'gone', which is missing"),
        ({"nodes": {"root": {"meshes": ["gone"]}}}, "'gone', which is missing"),
        ({"accessors": []}, "'corners', which is missing"),
        ({"meshes": {"red": {"primitives": [{}]}}}, "'attributes', which is missing"),
        ({"meshes": 7}, "not as in glTF 1.0"),
        ({"materials": {"red": 7, "blue": {}}}, "not as in glTF 1.0"),
        ({"buffers": {"b": {"byteLength": 4, "uri": "../b.bin"}}}, "which is not there"),
        ({"buffers": {"b": {"byteLength": 4}}}, "'uri', which is missing"),
        ({"asset": {"version": "3.0"}}, "is glTF 3.0; glTF 1.0 and 2.0 are read"),
    ],
)
def test_a_document_that_contradicts_itself_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read(document(**changes))


@pytest.mark.parametrize("kept", [8, 19, 60, 500, -1])
def test_a_binary_file_that_is_cut_off_is_refused(kept: int) -> None:
    with pytest.raises(InputError, match="corrupt"):
        read_shape(binary(document())[:kept], Format.GLB, "a.glb")
