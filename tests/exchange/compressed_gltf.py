"""glTF files of one square, compressed or with integers."""

from __future__ import annotations

import json
from typing import Any

import DracoPy
import numpy as np

from katana450.maths.geometry.arrays import FloatArray
from tests.exchange.test_broken_shapes import glb

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "<f4")

FACES = np.array([[0, 1, 2], [0, 2, 3]], "<u2")

DATA = POINTS.tobytes() + FACES.tobytes()

SQUARE: dict[str, Any] = {
    "asset": {"version": "2.0"},
    "buffers": [{"byteLength": 60, "uri": "parts/a%20b.bin"}],
    "bufferViews": [
        {"buffer": 0, "byteLength": 48},
        {"buffer": 0, "byteOffset": 48, "byteLength": 12},
    ],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
        {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
    ],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "nodes": [{"mesh": 0}],
    "scenes": [{"nodes": [0]}],
}


def draco(points: FloatArray) -> tuple[dict[str, Any], bytes]:
    """Return the document of a square of ``points`` (4, 3), and its compressed buffer."""
    data = DracoPy.encode(points.astype("f4"), FACES.astype("u4"), quantization_bits=14)
    extension = {"bufferView": 0, "attributes": {"POSITION": 0}}
    primitive = SQUARE["meshes"][0]["primitives"][0] | {
        "extensions": {"KHR_draco_mesh_compression": extension}
    }
    return SQUARE | {
        "extensionsRequired": ["KHR_draco_mesh_compression"],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
        "accessors": [
            {"componentType": 5126, "count": 4, "type": "VEC3"},
            {"componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "meshes": [{"primitives": [primitive]}],
    }, data


def quantized() -> tuple[dict[str, Any], bytes]:
    """Return the document of the square in normalized integers, and its buffer."""
    # Rows of a multiple of four bytes, so the fourth number is unused.
    rows = np.zeros((4, 4), "<u2")
    rows[:, :3] = POINTS * 65535
    data = rows.tobytes() + FACES.tobytes()
    return SQUARE | {
        "extensionsRequired": ["KHR_mesh_quantization"],
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 32, "byteStride": 8},
            {"buffer": 0, "byteOffset": 32, "byteLength": 12},
        ],
        "accessors": [
            SQUARE["accessors"][0] | {"componentType": 5123, "normalized": True},
            SQUARE["accessors"][1],
        ],
    }, data


def draco_glb() -> bytes:
    """Return a square compressed by Draco as .glb."""
    document, data = draco(POINTS)
    return glb(json.dumps(document).encode(), data)
