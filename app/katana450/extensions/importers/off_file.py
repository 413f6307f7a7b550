"""OFF as text: vertices with their colours, and polygons.

Source: Geomview manual, OFF.
"""

from __future__ import annotations

import re

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.surface import MeshReading, of_polygons
from katana450.maths.geometry.arrays import FloatArray

HEADER = re.compile(r"(C?N?OFF)(?![A-Za-z])(.*)")
"""First word of a file, and what follows: C stands for colours, N for normals."""

Rows = list[tuple[int, list[str]]]
"""Words of lines, with the numbers of the lines."""


def read_off(data: bytes, name: str) -> MeshReading:
    """Return all polygons. Raises InputError with the line of an error."""
    lines = enumerate(data.decode("utf-8", "replace").splitlines(), 1)
    rows = [(line, row) for line, text in lines if (row := text.partition("#")[0].split())]
    header = HEADER.fullmatch(rows[0][1].pop(0)) if rows else None
    if header is None or rows[0][1][:1] == ["BINARY"]:
        raise InputError(f"{name} is not OFF text: it must begin with OFF, COFF, NOFF or CNOFF.")
    kind, rest = header.groups()
    rows[0][1][:0] = [rest] if rest else []
    rows = rows if rows[0][1] else rows[1:]
    words = [(line, word) for line, row in rows for word in row]
    if len(words) < 2 or not all(re.fullmatch("[0-9]{1,9}", word) for _, word in words[:2]):
        raise InputError(f"{name} is corrupt: the numbers of vertices and faces are missing.")
    count, polygons = (int(word) for _, word in words[:2])
    width = 3 + 3 * ("N" in kind)
    # The third number, of the edges, may be left out.
    first, table = len(rows[0][1]), rows[1:]
    is_by_line = first in (2, 3) and count + polygons <= len(table)
    if not is_by_line or any(len(row) < width for _, row in table[:count]):
        table = _rearranged(words[2 if first == 2 else 3 :], count, polygons, width, name)
    vertices = _vertices(table[:count], name)
    corners: list[int] = []
    sizes: list[int] = []
    for line, row in table[count : count + polygons]:
        try:
            size = int(row[0])
            face = [int(word) for word in row[1 : 1 + max(size, 0)]]
        except ValueError as error:
            raise InputError(f"{name}, line {line}: expected whole numbers.") from error
        if len(face) != size or any(abs(corner) > 1 << 31 for corner in face):
            raise InputError(f"{name}, line {line}: this face does not have {row[0]} corners.")
        corners += face
        sizes.append(size)
    colours = None
    if kind.startswith("C") and vertices.shape[1] >= width + 3:
        colours = vertices[:, width : width + 4]
        maximum = 255.0 if (colours > 1.0).any() else 1.0
        colours = np.column_stack((colours / maximum, np.ones(count)))[:, :4]
    surface = of_polygons(
        vertices[:, :3],
        np.array(corners, dtype=np.int64),
        np.array(sizes, dtype=np.int64),
        name,
        vertex_colours=colours,
    )
    return MeshReading(surface)


def _rearranged(
    words: list[tuple[int, str]], count: int, polygons: int, width: int, name: str
) -> Rows:
    """Return one row for each vertex and each face, of words that are divided in another way.

    width: numbers of a vertex. Such a file has no colours.
    """
    rows: Rows = []
    start = 0
    for item in range(count + polygons):
        length = width
        if item >= count:
            size = words[start][1] if start < len(words) else ""
            length = 1 + int(size) if size.isdecimal() and len(size) < 10 else 1
        if start + length > len(words):
            raise InputError(f"{name} is corrupt: it ends too early.")
        row = words[start : start + length]
        rows.append((row[0][0], [word for _, word in row]))
        start += length
    return rows


def _vertices(rows: Rows, name: str) -> FloatArray:
    """Return (n, k) numbers, where k is the length of the shortest row."""
    width = min((len(row) for _, row in rows), default=3)
    table = np.empty((len(rows), width))
    for number, (line, row) in enumerate(rows):
        try:
            table[number] = [float(word) for word in row[:width]]
        except ValueError as error:
            raise InputError(f"{name}, line {line}: expected numbers.") from error
    return table
