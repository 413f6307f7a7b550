"""OFF as text: a row for each vertex, with its colour, and for each polygon.

Source: Geomview manual, OFF.
"""

from __future__ import annotations

import re

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.surface import MeshReading, of_polygons

HEADER = re.compile(r"(C?N?OFF)(?![A-Za-z])(.*)")
"""First word of a file, and what follows: C stands for colours, N for normals."""


def read_off(data: bytes, name: str) -> MeshReading:
    """Return all polygons. Raises InputError with the line of an error."""
    lines = enumerate(data.decode("utf-8", "replace").splitlines(), 1)
    rows = [(line, row) for line, text in lines if (row := text.partition("#")[0].split())]
    header = HEADER.fullmatch(rows[0][1].pop(0)) if rows else None
    if header is None or rows[0][1][:1] == ["BINARY"]:
        raise InputError(f"{name} is not OFF text: it must begin with OFF, COFF, NOFF or CNOFF.")
    kind, rest = header.groups()
    rows[0][1][:0] = [rest] if rest else []
    # The numbers may stand behind the header.
    rows = rows if rows[0][1] else rows[1:]
    numbers, table = rows[0][1] if rows else [], rows[1:]
    # The third number, of the edges, may be left out.
    if len(numbers) < 2 or not all(re.fullmatch("[0-9]{1,9}", word) for word in numbers[:2]):
        raise InputError(f"{name} is corrupt: the numbers of vertices and faces are missing.")
    count, polygons = map(int, numbers[:2])
    width = 3 + 3 * ("N" in kind)
    if count + polygons > len(table):
        raise InputError(f"{name} is corrupt: it ends too early.")
    # Some rows have a colour of three numbers, others one of four.
    columns = min((len(row) for _, row in table[:count]), default=width)
    vertices = np.empty((count, columns))
    for number, (line, row) in enumerate(table[:count]):
        if len(row) < width:
            raise InputError(f"{name}, line {line}: a vertex has {width} numbers in this file.")
        try:
            vertices[number] = [float(word) for word in row[:columns]]
        except ValueError as error:
            raise InputError(f"{name}, line {line}: expected numbers.") from error
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
    if kind.startswith("C") and columns >= width + 3:
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
