"""A robot as binary glTF 2.0: one node per link."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from katana450.arm.robot.glb_file import GlbFile
from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.errors import InputError
from katana450.extensions.export.files import distinct
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.srgb import to_light

Y_UP = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
"""Rotation (x, y, z, w) from the root's z up to glTF's y up."""


def glb_files(robot: Robot, values: Mapping[str, float]) -> dict[str, bytes]:
    """Return name and content of the file, at ``values`` [rad, m]."""
    (name,) = distinct([robot.name])
    return {f"{name}.glb": _Document(robot, values).content()}


class _Document:
    """The document under construction."""

    def __init__(self, robot: Robot, values: Mapping[str, float]) -> None:
        self._file = GlbFile()
        self._meshes: list[dict[str, Any]] = []
        self._materials: dict[Material, int] = {}
        self._robot, self._values = robot, values
        # Node 0 rotates z up to y up; the node of link k is node k + 1.
        self._number = {link.name: place for place, link in enumerate(robot.links, start=1)}

    def content(self) -> bytes:
        """Return the content of the file."""
        upright = {"name": "z_up", "rotation": Y_UP, "children": [1]}
        nodes = [upright, *map(self._node, self._robot.links)]
        return self._file.content(
            scenes=[{"name": self._robot.name, "nodes": [0]}],
            nodes=nodes,
            meshes=self._meshes,
            materials=[_material(material) for material in self._materials],
        )

    def _node(self, link: Link) -> dict[str, Any]:
        T, joint = link.T_parent_link, link.joint
        if joint is not None:
            T = T @ joint.motion(self._values[joint.name])
        node: dict[str, Any] = {
            "name": link.name,
            "translation": T[:3, 3].tolist(),
            "rotation": _xyzw(T[:3, :3]),
        }
        children = [self._number[child.name] for child in self._robot.children(link)]
        if children:
            node["children"] = children
        if link.shapes:
            node["mesh"] = len(self._meshes)
            primitives = [self._primitive(shape) for shape in link.shapes]
            self._meshes.append({"name": link.name, "primitives": primitives})
        return node

    def _primitive(self, shape: VisualMesh) -> dict[str, Any]:
        if not (np.isfinite(shape.vertices).all() and np.isfinite(shape.normals).all()):
            raise InputError("A shape has coordinates that are not finite numbers.")
        return {
            "attributes": {
                "POSITION": self._file.add(shape.vertices),
                "NORMAL": self._file.add(shape.normals),
            },
            "indices": self._file.add(shape.faces.reshape(-1, 1)),
            "material": self._materials.setdefault(shape.material, len(self._materials)),
        }


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
