"""A robot as binary glTF 2.0: one node per link, its joint in `extras`."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.errors import InputError
from katana450.extensions.export.files import distinct
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.srgb import to_light

ARRAY, ELEMENT = 34962, 34963
"""Targets of a buffer view."""
FLOAT, USHORT, UINT = 5126, 5123, 5125
"""Component types of an accessor."""

Y_UP = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""Rotation (x, y, z, w) from the root's z up to glTF's y up."""


def glb_files(robot: Robot, values: Mapping[str, float]) -> dict[str, bytes]:
    """Return name and content of the file, at ``values`` [rad, m]."""
    (name,) = distinct([robot.name])
    return {f"{name}.glb": _Document(robot, values).content()}


class _Document:
    """The JSON chunk and the binary chunk under construction."""

    def __init__(self, robot: Robot, values: Mapping[str, float]) -> None:
        self._data = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []
        self._meshes: list[dict[str, Any]] = []
        self._materials: dict[Material, int] = {}
        # Node 0 rotates z up to y up; the node of link k is node k + 1.
        number = {link.name: place for place, link in enumerate(robot.links, start=1)}
        nodes: list[dict[str, Any]] = [{"name": "z_up", "rotation": Y_UP, "children": [1]}]
        nodes += [self._node(robot, link, values, number) for link in robot.links]
        self._json: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "katana450"},
            "scene": 0,
            "scenes": [{"name": robot.name, "nodes": [0]}],
            "nodes": nodes,
        }

    def content(self) -> bytes:
        """Return the content of the file."""
        parts = {
            "meshes": self._meshes,
            "materials": [_material(material) for material in self._materials],
            "accessors": self._accessors,
            "bufferViews": self._views,
            "buffers": [{"byteLength": len(self._data)}] if self._data else [],
        }
        document = self._json | {name: part for name, part in parts.items() if part}
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        if self._data:
            chunks += struct.pack("<I4s", len(self._data), b"BIN\0") + bytes(self._data)
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def _node(
        self,
        robot: Robot,
        link: Link,
        values: Mapping[str, float],
        number: Mapping[str, int],
    ) -> dict[str, Any]:
        T, joint = link.T_parent_link, link.joint
        if joint is not None:
            T = T @ joint.motion(values[joint.name])
        node: dict[str, Any] = {
            "name": link.name,
            "translation": T[:3, 3].tolist(),
            "rotation": _xyzw(T[:3, :3]),
        }
        children = [number[child.name] for child in robot.children(link)]
        if children:
            node["children"] = children
        if joint is not None:
            node["extras"] = {"joint": _joint_extras(joint)}
        if link.shapes:
            node["mesh"] = len(self._meshes)
            primitives = [self._primitive(shape) for shape in link.shapes]
            self._meshes.append({"name": link.name, "primitives": primitives})
        return node

    def _primitive(self, shape: VisualMesh) -> dict[str, Any]:
        index = shape.faces.reshape(-1, 1)
        wide = len(shape.vertices) >= 1 << 16
        return {
            "attributes": {
                "POSITION": self._vectors(shape.vertices, ARRAY),
                "NORMAL": self._vectors(shape.normals, ARRAY),
            },
            "indices": self._add(
                index.astype("<u4" if wide else "<u2"), UINT if wide else USHORT, ELEMENT
            ),
            "material": self._materials.setdefault(shape.material, len(self._materials)),
        }

    def _vectors(self, rows: FloatArray, target: int | None = None) -> int:
        if not np.isfinite(rows).all():
            raise InputError("A shape has coordinates that are not finite numbers.")
        return self._add(rows.astype("<f4"), FLOAT, target)

    def _add(self, rows: npt.NDArray[Any], kind: int, target: int | None) -> int:
        """Append rows (n, width) and return the number of their accessor."""
        raw = rows.tobytes()
        view = {"buffer": 0, "byteOffset": len(self._data), "byteLength": len(raw)}
        self._views.append(view if target is None else view | {"target": target})
        self._data += raw + bytes(-len(raw) % 4)
        accessor: dict[str, Any] = {
            "bufferView": len(self._views) - 1,
            "componentType": kind,
            "count": len(rows),
            "type": {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[rows.shape[1]],
        }
        if kind == FLOAT:
            accessor |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
        self._accessors.append(accessor)
        return len(self._accessors) - 1


def _xyzw(R: FloatArray) -> list[float]:
    w, x, y, z = so3.to_quaternion(R).tolist()
    return [x, y, z, w]


def _material(material: Material) -> dict[str, Any]:
    return {
        "name": material.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*to_light(material.colour).tolist(), 1.0],
            "metallicFactor": material.metallic,
            "roughnessFactor": material.rough,
        },
    }


def _joint_extras(joint: Joint) -> dict[str, Any]:
    extras: dict[str, Any] = {
        "name": joint.name,
        "type": "prismatic" if joint.slides else "revolute",
        "axis": joint.axis.tolist(),
    }
    for side, limit in (("lower", joint.lower), ("upper", joint.upper)):
        if math.isfinite(limit):
            extras[side] = limit
    if joint.leader != joint.name:
        extras["mimic"] = {
            "joint": joint.leader,
            "multiplier": joint.factor,
            "offset": joint.offset,
        }
    return extras
