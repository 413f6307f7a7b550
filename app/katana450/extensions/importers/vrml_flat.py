"""Flat surfaces of X3D in the plane z = 0, seen from the front.

Source: ISO/IEC 19775-1:2023, 14.3 ArcClose2D, Disk2D, Rectangle2D and TriangleSet2D.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from katana450.extensions.export.vrml_node import Node
from katana450.extensions.importers.surface import MeshSurface, of_polygons
from katana450.extensions.importers.vrml_lines import arc, in_plane
from katana450.extensions.importers.vrml_solids import ROUND, number, numbers, texts
from katana450.maths.geometry.arrays import FloatArray


def _polygon(flat: FloatArray, name: str) -> MeshSurface:
    return of_polygons(in_plane(flat), np.arange(len(flat)), np.array([len(flat)]), name)


def _rectangle(node: Node, name: str, _left_out: Counter[str]) -> MeshSurface:
    half = numbers(node, "size", (2.0, 2.0))[:, 0] / 2.0
    return _polygon(half * np.array(((-1, -1), (1, -1), (1, 1), (-1, 1))), name)


def _disk(node: Node, name: str, _left_out: Counter[str]) -> MeshSurface:
    inner, outer = number(node, "innerRadius", 0.0), number(node, "outerRadius", 1.0)
    here = np.arange(ROUND)
    ahead = np.roll(here, -1)
    turn = here * (2.0 * np.pi / ROUND)
    ring = np.column_stack((np.cos(turn), np.sin(turn)))
    quads = np.column_stack((here, ROUND + here, ROUND + ahead, ahead))
    points = in_plane(np.concatenate((inner * ring, outer * ring)))
    return of_polygons(points, quads.ravel(), np.full(ROUND, 4), name).tidy()


def _triangles(node: Node, name: str, _left_out: Counter[str]) -> MeshSurface:
    flat = numbers(node, "vertices", (), 2)
    count = len(flat) // 3
    return of_polygons(in_plane(flat), np.arange(3 * count), np.full(count, 3), name)


def _closed_arc(node: Node, name: str, _left_out: Counter[str]) -> MeshSurface:
    points = arc(node)
    if "CHORD" not in texts(node.get("closureType")):
        points = np.concatenate((points, np.zeros((1, 2))))
    return _polygon(points, name)


FLAT: dict[str, Callable[[Node, str, Counter[str]], MeshSurface]] = {
    "Rectangle2D": _rectangle,
    "Disk2D": _disk,
    "TriangleSet2D": _triangles,
    "ArcClose2D": _closed_arc,
}
"""The function that builds the surface, by the kind of a node."""
