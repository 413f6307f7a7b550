"""OFF of text: vertices with their colours, and polygons.

Source: Geomview manual, OFF. trimesh cuts concave polygons into fans and reads no colours.
"""

from __future__ import annotations

import re

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.surface import Reading, of_polygons

HEADERS = ("OFF", "COFF", "NOFF", "CNOFF")
"""Words that a file begins with: C has colours, N has normals."""


Rows = list[tuple[int, list[str]]]
"""Numbers of lines, and their words."""


def read_off(data: bytes, name: str) -> Reading:
    """Return all polygons. Raises InputError with the line of what is none."""
    lines = data.decode("utf-8", "replace").splitlines()
    rows = [(number, line.partition("#")[0].split()) for number, line in enumerate(lines, 1)]
    rows = [(number, words) for number, words in rows if words]
    header = rows[0][1].pop(0) if rows else ""
    if header not in HEADERS or "BINARY" in rows[0][1]:
        raise InputError(
            f"{name} does not begin with {' or '.join(HEADERS)} and is no OFF of text."
        )
    rows = [(number, words) for number, words in rows if words]
    counts = rows[0][1][:2] if rows else []
    if len(counts) < 2 or not all(re.fullmatch("[0-9]{1,9}", each) for each in counts):
        raise InputError(f"{name} is broken: it does not tell how many vertices and faces it has.")
    count, polygons = map(int, counts)
    if count + polygons > len(rows) - 1:
        raise InputError(f"{name} is broken: it ends too early.")
    table = _numbers(rows[1 : 1 + count], name)
    faces = _faces(rows[1 + count : 1 + count + polygons], name)
    width = 3 + 3 * ("N" in header)
    if any(len(row) < width for row in table):
        raise InputError(f"{name} has vertices with less than {width} numbers.")
    colours = None
    if header.startswith("C") and all(len(row) >= width + 3 for row in table):
        most = 255.0 if any(max(row[width : width + 3]) > 1.0 for row in table) else 1.0
        colours = np.array([[*row[width : width + 4], most][:4] for row in table]) / most
    surface = of_polygons(
        np.array([row[:3] for row in table], dtype=np.float64).reshape(-1, 3),
        np.array([corner for face in faces for corner in face], dtype=np.int64),
        np.array([len(face) for face in faces], dtype=np.int64),
        name,
        vertex_colours=colours,
    )
    return Reading(surface)


def _numbers(rows: Rows, name: str) -> list[list[float]]:
    found: list[list[float]] = []
    for number, words in rows:
        try:
            found.append([float(word) for word in words])
        except ValueError as error:
            raise InputError(f"{name}, line {number}: numbers are wanted.") from error
    return found


def _faces(rows: Rows, name: str) -> list[list[int]]:
    found: list[list[int]] = []
    for number, words in rows:
        try:
            size = int(words[0])
            found.append([int(word) for word in words[1 : 1 + max(size, 0)]])
        except ValueError as error:
            raise InputError(f"{name}, line {number}: whole numbers are wanted.") from error
        if len(found[-1]) != size:
            raise InputError(f"{name}, line {number}: this face does not have {size} corners.")
    return found
