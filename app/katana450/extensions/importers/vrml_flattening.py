"""The visible surfaces of a parsed VRML97 world, in one frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import Node, Value
from katana450.extensions.importers.surface import MAX_COPIES, MeshBuilder, MeshSurface
from katana450.extensions.importers.vrml_solids import (
    number,
    numbers,
    part,
    surface_of,
    texts,
    unit,
)
from katana450.extensions.importers.vrml_standard import IGNORED_NODES
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray

GROUPS = ("Group", "Anchor", "Billboard", "Collision")
"""Kinds of groups whose children are all shown at their place."""

Shown = Callable[[tuple[str, ...]], MeshSurface | None]
"""A function that returns the surface of the first of several addresses that is there."""


class Flattening:
    """A traversal of the visible nodes, with the pose of each."""

    def __init__(self, name: str, left_out: Counter[str], shown: Shown) -> None:
        """Prepare the file ``name``. ``left_out`` counts the parts that are not read.

        ``shown`` returns the surface of another world.
        """
        self._name, self._left_out, self._shown_file = name, left_out, shown
        self._builder = MeshBuilder(name)
        self._surfaces: dict[int, MeshSurface | None] = {}
        self._visits = 0

    def surface(self, world: tuple[Node, ...]) -> MeshSurface:
        """Return the surface of all nodes of a file."""
        # Without recursion, because reused nodes can be nested deeper than the text.
        waiting = [(node, np.eye(4)) for node in reversed(world)]
        while waiting:
            node, T = waiting.pop()
            self._visits += 1
            if self._visits > MAX_COPIES:
                raise InputError(
                    f"{self._name} shows more than {MAX_COPIES} nodes, each counted as often as "
                    "it is used."
                )
            if node.kind == "Shape":
                self._shape(node, T)
            if node.kind == "Inline":
                found = self._shown_file(texts(node.get("url")))
                if found is not None:
                    self._builder.add(found.moved(T))
            waiting += [(child, T_child) for child, T_child in reversed(self._shown(node, T))]
        return self._builder.surface()

    def _shown(self, node: Node, T: FloatArray) -> list[tuple[Node, FloatArray]]:
        """Return the visible children of a node with their poses."""
        match node.kind:
            case kind if kind in GROUPS:
                return [(child, T) for child in nodes(node.get("children"))]
            case "Transform":
                with np.errstate(over="ignore", invalid="ignore"):
                    T_children = T @ placed(node)
                return [(child, T_children) for child in nodes(node.get("children"))]
            case "Switch":
                chosen = int(number(node, "whichChoice", -1.0))
                choice = nodes(node.get("choice"))
                return [(choice[chosen], T)] if 0 <= chosen < len(choice) else []
            case "LOD":
                return [(child, T) for child in nodes(node.get("level"))[:1]]
            case "Shape" | "Inline":
                pass
            case kind if kind not in IGNORED_NODES:
                self._left_out[kind] += 1
        return []

    def _shape(self, node: Node, T: FloatArray) -> None:
        geometry = part(node, "geometry")
        if geometry is None:
            return
        if id(geometry) not in self._surfaces:
            self._surfaces[id(geometry)] = surface_of(geometry, self._name, self._left_out)
        surface = self._surfaces[id(geometry)]
        if surface is not None:
            self._builder.add(surface.painted(_colour(node)).moved(T))
        elif geometry.kind != "NULL":
            self._left_out[geometry.kind] += 1


def nodes(value: Value | None) -> list[Node]:
    """Return the nodes in a field."""
    items = value if isinstance(value, tuple) else (value,)
    return [item for item in items if isinstance(item, Node)]


def placed(node: Node) -> FloatArray:
    """Return the pose (4, 4) of a Transform, 6.52: P' = T C R SR S -SR -C P."""
    moved, center = (numbers(node, key, (0.0,) * 3)[:, 0] for key in ("translation", "center"))
    scale = numbers(node, "scale", (1.0,) * 3)[:, 0]
    R, SR = (rotation(node, key) for key in ("rotation", "scaleOrientation"))
    A = R @ (SR * scale) @ SR.T
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = A, moved + center - A @ center
    return T


def rotation(node: Node, field: str) -> FloatArray:
    """Return the rotation (3, 3) in a field of axis and angle."""
    x, y, z, angle = numbers(node, field, (0.0, 0.0, 1.0, 0.0))[:, 0]
    # Reduced to one turn, because the sine of a very large angle is noise.
    return so3.exp(unit(np.array((x, y, z))) * float(np.remainder(angle, 2.0 * np.pi)))


def _colour(shape: Node) -> tuple[float, ...] | None:
    """Return the colour (4,) 0..1 of its material; None without a material."""
    appearance = part(shape, "appearance")
    material = None if appearance is None else part(appearance, "material")
    if material is None or material.kind != "Material":
        return None
    diffuse = numbers(material, "diffuseColor", (0.8, 0.8, 0.8))[:, 0]
    glow = numbers(material, "emissiveColor", (0.0, 0.0, 0.0))[:, 0]
    shown = diffuse if diffuse.any() else glow
    return (*shown.tolist(), 1.0 - number(material, "transparency", 0.0))
