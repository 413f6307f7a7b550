"""Lines and points of VRML97 and X3D.

Sources: ISO/IEC 14772-1:1997, 6.24 IndexedLineSet, 6.36 PointSet; ISO/IEC 19775-1:2023, 11.4.8
LineSet, 14.3 Arc2D, Circle2D, Polyline2D and Polypoint2D.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np

from katana450.extensions.export.vrml_node import Node
from katana450.extensions.importers.surface import MeshSurface, of_lines
from katana450.extensions.importers.vrml_solids import (
    ROUND,
    chosen_colours,
    colour_table,
    coordinates,
    flag,
    number,
    numbers,
    split,
)
from katana450.maths.geometry.arrays import FloatArray, IntArray


def _line_set(node: Node, _name: str, left_out: Counter[str]) -> MeshSurface:
    vertices = coordinates(node)
    if node.kind == "IndexedLineSet":
        index, sizes = split(numbers(node, "coordIndex", ())[:, 0].astype(np.int64))
    else:
        counts = np.maximum(numbers(node, "vertexCount", ())[:, 0].astype(np.int64), 0)
        sizes = np.diff(np.minimum(np.cumsum(counts), len(vertices)), prepend=0)
        index = np.arange(int(sizes.sum()))
    owner = np.repeat(np.arange(len(sizes)), sizes)
    first = np.flatnonzero(owner[1:] == owner[:-1])
    ends = np.column_stack((index[first], index[first + 1]))
    colours = _corner_colours(node, index, sizes, left_out)
    if colours is not None:
        colours = 0.5 * (colours[first] + colours[first + 1])
    return of_lines(vertices, ends, node.kind, colours)


def _corner_colours(
    node: Node, index: IntArray, sizes: IntArray, left_out: Counter[str]
) -> FloatArray | None:
    """Return the colour (k, 4) of each corner of the lines; None without colours."""
    table = colour_table(node, left_out)
    if table is None:
        return None
    listed = numbers(node, "colorIndex", ())[:, 0].astype(np.int64)
    if flag(node, "colorPerVertex"):
        places, their_sizes = split(listed) if len(listed) else (index, sizes)
        return chosen_colours(table, places, np.array_equal(sizes, their_sizes), left_out)
    places = (listed if len(listed) else np.arange(len(sizes)))[: len(sizes)]
    fits = len(places) == len(sizes)
    return chosen_colours(table, np.repeat(places, sizes) if fits else places, fits, left_out)


def _point_set(node: Node, _name: str, left_out: Counter[str]) -> MeshSurface:
    vertices, table = coordinates(node), colour_table(node, left_out)
    each = np.arange(len(vertices))
    colours = None if table is None else chosen_colours(table, each, True, left_out)
    return of_lines(vertices, np.column_stack((each, each)), node.kind, colours)


def _flat_lines(node: Node, _name: str, _left_out: Counter[str]) -> MeshSurface:
    """Return the lines or points of a node in the plane z = 0."""
    if node.kind in ("Polyline2D", "Polypoint2D"):
        field = "lineSegments" if node.kind == "Polyline2D" else "point"
        flat = numbers(node, field, (), 2)
    else:
        flat = arc(node)
    each = np.arange(len(flat))
    ends = (each, each) if node.kind == "Polypoint2D" else (each[:-1], each[1:])
    return of_lines(in_plane(flat), np.column_stack(ends), node.kind)


def arc(node: Node) -> FloatArray:
    """Return points (k, 2) on a circle, or on the arc of a node that has angles."""
    start, end = 0.0, 2.0 * np.pi
    if node.kind != "Circle2D":
        start, end = number(node, "startAngle", 0.0), number(node, "endAngle", np.pi / 2.0)
        end = start + (float(np.remainder(end - start, 2.0 * np.pi)) or 2.0 * np.pi)
    angles = np.linspace(start, end, ROUND + 1)
    return number(node, "radius", 1.0) * np.column_stack((np.cos(angles), np.sin(angles)))


def in_plane(flat: FloatArray) -> FloatArray:
    """Return points (k, 2) as points (k, 3) of the plane z = 0."""
    return np.column_stack((flat, np.zeros(len(flat))))


LINES: dict[str, Callable[[Node, str, Counter[str]], MeshSurface]] = {
    "IndexedLineSet": _line_set,
    "LineSet": _line_set,
    "PointSet": _point_set,
    **dict.fromkeys(("Arc2D", "Circle2D", "Polyline2D", "Polypoint2D"), _flat_lines),
}
"""The function that builds the lines, by the kind of a node."""
