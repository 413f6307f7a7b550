"""Writing of binary glTF 2.0 for links: one mesh, one primitive for each material."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_description.cad.material import Material

_ARRAY, _ELEMENT = 34962, 34963
_FLOAT, _USHORT, _UINT = 5126, 5123, 5125


@dataclass(frozen=True)
class Primitive:
    """Indexed triangles of one material: (n, 3) positions in metres, normals, (m, 3) indices."""

    material: Material
    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    triangles: NDArray[np.int64]


class _Buffer:
    """The growing binary chunk, with the views and accessors that describe it."""

    def __init__(self) -> None:
        self.data = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(self, values: NDArray[Any], target: int, **accessor: Any) -> int:
        """Append ``values`` and return the index of their accessor."""
        raw = values.tobytes()
        self.views.append(
            {
                "buffer": 0,
                "byteOffset": len(self.data),
                "byteLength": len(raw),
                "target": target,
            }
        )
        self.data += raw + bytes(-len(raw) % 4)
        self.accessors.append({"bufferView": len(self.views) - 1, **accessor})
        return len(self.accessors) - 1


def _vectors(buffer: _Buffer, values: NDArray[np.float32], bounds: bool) -> int:
    # The sum makes a zero of a negative one, whose sign depends on how a processor adds.
    rows = (values + np.float32(0.0)).astype("<f4")
    extent = {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()} if bounds else {}
    return buffer.add(rows, _ARRAY, componentType=_FLOAT, count=len(rows), type="VEC3", **extent)


def glb_bytes(name: str, primitives: list[Primitive]) -> bytes:
    """Return the GLB file of the mesh ``name``; the same input gives the same bytes."""
    buffer = _Buffer()
    parts = []
    for number, primitive in enumerate(primitives):
        wide = len(primitive.positions) > 65535
        index = primitive.triangles.reshape(-1).astype("<u4" if wide else "<u2")
        parts.append(
            {
                "attributes": {
                    "POSITION": _vectors(buffer, primitive.positions, bounds=True),
                    "NORMAL": _vectors(buffer, primitive.normals, bounds=False),
                },
                "indices": buffer.add(
                    index,
                    _ELEMENT,
                    componentType=_UINT if wide else _USHORT,
                    count=len(index),
                    type="SCALAR",
                ),
                "material": number,
            }
        )
    document = {
        "asset": {"version": "2.0", "generator": "robot_description.cad"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": name, "mesh": 0}],
        "meshes": [{"name": name, "primitives": parts}],
        "materials": [
            {
                "name": primitive.material.name,
                "pbrMetallicRoughness": {
                    "baseColorFactor": primitive.material.linear_colour(),
                    "metallicFactor": primitive.material.metallic,
                    "roughnessFactor": primitive.material.rough,
                },
            }
            for primitive in primitives
        ],
        "accessors": buffer.accessors,
        "bufferViews": buffer.views,
        "buffers": [{"byteLength": len(buffer.data)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    body = bytes(buffer.data)
    return b"".join(
        (
            struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(body)),
            struct.pack("<I4s", len(text), b"JSON"),
            text,
            struct.pack("<I4s", len(body), b"BIN\0"),
            body,
        )
    )
