"""OFF as text: vertices with their colours, and polygons.

Source: Geomview manual, OFF. trimesh cuts concave polygons into fans and reads no colours.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.importers.surface import MeshReading, of_polygons
from katana450.maths.geometry.arrays import FloatArray, IntArray

HEADER = re.compile(r"(C?N?OFF)(?![A-Za-z])\s*(.*)")
"""First word of a file, and what follows: C stands for colours, N for normals."""

Rows = list[tuple[int, str]]
"""Lines of a file with their numbers."""

MAX_ARRAY_ROW = 400
"""Maximum number of characters of a line for conversion of all rows as one array."""


def read_off(data: bytes, name: str) -> MeshReading:
    """Return all polygons. Raises InputError with the line of an error."""
    lines = enumerate(data.decode("utf-8", "replace").splitlines(), 1)
    rows = [(number, row) for number, line in lines if (row := line.partition("#")[0].strip())]
    header = HEADER.match(rows[0][1]) if rows else None
    if header is None or "BINARY" in header[2]:
        raise InputError(f"{name} is not OFF text: it must begin with OFF, COFF, NOFF or CNOFF.")
    rows[:1] = [(rows[0][0], header[2])] if header[2] else []
    # The third number, of the edges, may be left out.
    if rows and len(rows[0][1].split()) not in (2, 3):
        words = _words(rows)
        rows = [(rows[0][0], " ".join(word for _, word in words[:3])), *words[3:]]
    counts = re.match(r"([0-9]{1,9})\s+([0-9]{1,9})\b", rows[0][1]) if rows else None
    if counts is None:
        raise InputError(f"{name} is corrupt: the numbers of vertices and faces are missing.")
    count, polygons = int(counts[1]), int(counts[2])
    width = 3 + 3 * ("N" in header[1])
    if count + polygons > len(rows) - 1 or any(
        len(row.split()) < width for _, row in rows[1 : 1 + count]
    ):
        rows[1:] = _rearranged(rows[1:], count, polygons, width, name)
    table = _numbers(rows[1 : 1 + count], name)
    if table.shape[1] < width:
        raise InputError(f"{name} has no vertices of {width} numbers.")
    corners, sizes = _faces(rows[1 + count : 1 + count + polygons], name)
    colours = None
    if header[1].startswith("C") and table.shape[1] >= width + 3:
        colours = table[:, width : width + 4]
        maximum = 255.0 if (colours > 1.0).any() else 1.0
        colours = np.column_stack((colours / maximum, np.ones(count)))[:, :4]
    surface = of_polygons(table[:, :3], corners, sizes, name, vertex_colours=colours)
    return MeshReading(surface)


def _rearranged(rows: Rows, count: int, polygons: int, width: int, name: str) -> Rows:
    """Return one row for each vertex and each face, of rows that are divided in another way.

    width: numbers of a vertex. Such a file has no colours.
    """
    words = _words(rows)
    arranged: Rows = []
    start = 0
    for item in range(count + polygons):
        length = width
        if item >= count:
            size = words[start][1] if start < len(words) else ""
            length = 1 + int(size) if size.isdecimal() and len(size) < 10 else 1
        if start + length > len(words):
            raise InputError(f"{name} is corrupt: it ends too early.")
        row = words[start : start + length]
        arranged.append((row[0][0], " ".join(word for _, word in row)))
        start += length
    return arranged


def _words(rows: Rows) -> Rows:
    return [(number, word) for number, row in rows for word in row.split()]


def _numbers(rows: Rows, name: str) -> FloatArray:
    """Return (n, k) numbers, where k is the length of the shortest row."""
    found = _array(rows, np.float64)
    if found is not None:
        return found
    table: list[list[float]] = []
    for number, row in rows:
        try:
            table.append([float(word) for word in row.split()])
        except ValueError as error:
            raise InputError(f"{name}, line {number}: expected numbers.") from error
    width = min(map(len, table), default=0)
    return np.array([row[:width] for row in table], dtype=np.float64).reshape(len(table), width)


def _faces(rows: Rows, name: str) -> tuple[IntArray, IntArray]:
    """Return the corners of all faces, face after face, and the number of corners of each."""
    found = _array(rows, np.int64)
    size = -1 if found is None else int(found[0, 0])
    if found is not None and 0 <= size < found.shape[1] and (found[:, 0] == size).all():
        return found[:, 1 : 1 + size].ravel(), found[:, 0]
    corners: list[int] = []
    sizes: list[int] = []
    for number, row in rows:
        words = row.split()
        try:
            sizes.append(int(words[0]))
            corners += [int(word) for word in words[1 : 1 + max(sizes[-1], 0)]]
        except ValueError as error:
            raise InputError(f"{name}, line {number}: expected whole numbers.") from error
        if not 0 <= sizes[-1] < len(words):
            raise InputError(f"{name}, line {number}: this face does not have {words[0]} corners.")
    if any(abs(corner) > 1 << 31 for corner in corners):
        raise InputError(f"{name} has a face with a vertex that does not exist.")
    return np.array(corners, dtype=np.int64), np.array(sizes, dtype=np.int64)


def _array(rows: Rows, kind: type[Any]) -> npt.NDArray[Any] | None:
    """Return the numbers of all rows; None if rows differ in length or hold other text."""
    if not rows or max(len(row) for _, row in rows) > MAX_ARRAY_ROW:
        return None
    try:
        return np.array([row.split() for _, row in rows]).astype(kind)
    except (ValueError, OverflowError):
        return None
