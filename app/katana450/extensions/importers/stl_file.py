"""STL, binary and text, as 3D Systems' StereoLithography Interface Specification (1989) has it."""

from __future__ import annotations

import re

import numpy as np

from katana450.arm.robot.creases import Colours
from katana450.errors import InputError
from katana450.extensions.importers.surface import (
    MeshReading,
    check_triangles,
    doubles,
    of_polygons,
)
from katana450.maths.geometry.arrays import FloatArray

HEADER = 84
"""[bytes] Anything, and the number of triangles."""

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])

_VERTEX = rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)\s+"
_FACET = re.compile(
    rb"\s*facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop\s+"
    + _VERTEX * 3
    + rb"endloop\s+endfacet",
    re.IGNORECASE,
)
_SOLID = re.compile(rb"\s*(end)?solid\b[^\r\n]*", re.IGNORECASE)


def read_stl(data: bytes, name: str) -> MeshReading:
    """All triangles of all solids. Raises InputError for what is none."""
    count = int.from_bytes(data[80:84], "little")
    # Text begins with "solid", but so do some binary files.
    if len(data) >= HEADER and len(data) == HEADER + count * TRIANGLE.itemsize:
        check_triangles(count, name)
        rows = np.frombuffer(data, TRIANGLE, count, HEADER)
        left_out = ("colours, which STL has no rule for",) if rows["extra"].any() else ()
        return _reading(doubles(rows["corners"]), name, left_out)
    if _SOLID.match(data) and (b"facet" in data.lower() or len(data) < HEADER):
        return _reading(_text(data, name), name)
    if len(data) < HEADER:
        raise InputError(
            f"{name} is no STL file: neither a text that begins with 'solid', nor long."
        )
    raise InputError(
        f"{name} is broken, or no STL file: it says {count} triangles, which take "
        f"{HEADER + count * TRIANGLE.itemsize} bytes, but has {len(data)}."
    )


def _text(data: bytes, name: str) -> FloatArray:
    """(m, 3, 3) corners."""
    found: list[tuple[bytes, ...]] = []
    at, end, is_open = 0, len(data.rstrip()), False
    while at < end:
        match = _FACET.match(data, at) if is_open else None
        if match is not None:
            found.append(match.groups())
            check_triangles(len(found), name)
        else:
            match = _SOLID.match(data, at)
            if match is None or bool(match[1]) != is_open:
                raise _broken(data, at, name, "a facet, 'solid' or 'endsolid' is wanted")
            is_open = not is_open
        at = match.end()
    if is_open:
        raise _broken(data, end, name, "the file ends before 'endsolid'")
    try:
        return np.array(found, dtype=object).astype(np.float64).reshape(-1, 3, 3)
    except ValueError as error:
        raise InputError(
            f"{name} has coordinates that are no numbers: {str(error)[:80]}."
        ) from error


def _broken(data: bytes, at: int, name: str, what: str) -> InputError:
    blank = len(data[at:]) - len(data[at:].lstrip())
    line = data.count(b"\n", 0, at + blank) + 1
    return InputError(f"{name} is broken at line {line}: {what}.")


def _reading(corners: FloatArray, name: str, left_out: tuple[str, ...] = ()) -> MeshReading:
    places = np.arange(3 * len(corners))
    no_colours: Colours | None = None
    surface = of_polygons(
        corners.reshape(-1, 3), places, np.full(len(corners), 3), name, no_colours
    )
    return MeshReading(surface, left_out)
