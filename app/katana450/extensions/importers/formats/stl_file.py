"""STL, binary and text.

Source: 3D Systems, StereoLithography Interface Specification (1989).
"""

from __future__ import annotations

import re

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.formats.surface import MeshReading, doubles, of_polygons

HEADER = 84
"""[bytes] Size of the binary header: 80 bytes of any content, and the number of triangles."""

TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
"""A triangle of a binary file."""

_VERTEX = rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)\s+"
_FACET = re.compile(
    rb"\s*facet\s+normal\s+\S+\s+\S+\s+\S+\s+outer\s+loop\s+"
    + _VERTEX * 3
    + rb"endloop\s+endfacet",
    re.IGNORECASE,
)
_SOLID = re.compile(rb"\s*(end)?solid\b[^\r\n]*", re.IGNORECASE)


def read_stl(data: bytes, name: str) -> MeshReading:
    """Return all triangles of all solids. Raises InputError for an invalid file."""
    left_out: tuple[str, ...] = ()
    count = int.from_bytes(data[80:84], "little")
    # Some binary files begin with "solid" too, so the size decides.
    if len(data) >= HEADER and len(data) == HEADER + count * TRIANGLE.itemsize:
        rows = np.frombuffer(data, TRIANGLE, count, HEADER)
        points = doubles(rows["corners"]).reshape(-1, 3)
        if rows["extra"].any():
            left_out = ("colours, which the STL standard does not define",)
    elif _SOLID.match(data) and (b"facet" in data.lower() or len(data) < HEADER):
        corners = _corners(data, name)
        try:
            points = np.array(corners, dtype=object).astype(float).reshape(-1, 3)
        except ValueError as error:
            reason = str(error)[:80]
            raise InputError(f"{name} has coordinates that are not numbers: {reason}.") from error
    elif len(data) < HEADER:
        raise InputError(
            f"{name} is too short for an STL file: it has {len(data)} bytes of at least {HEADER}."
        )
    else:
        raise InputError(
            f"{name} is corrupt or not an STL file: it is no text of a 'solid', and it declares "
            f"{count} triangles, which take {HEADER + count * TRIANGLE.itemsize} bytes, but has "
            f"{len(data)} bytes."
        )
    places = np.arange(len(points))
    surface = of_polygons(points, places, np.full(len(points) // 3, 3), name)
    return MeshReading(surface, left_out)


def _corners(data: bytes, name: str) -> list[tuple[bytes, ...]]:
    """Return the nine numbers of each triangle of a text file."""
    corners: list[tuple[bytes, ...]] = []
    offset, end, is_open = 0, len(data.rstrip()), False
    while offset < end:
        match = _FACET.match(data, offset) if is_open else None
        if match is not None:
            corners.append(match.groups())
        else:
            match = _SOLID.match(data, offset)
            if match is None or bool(match[1]) != is_open:
                raise _broken(data, offset, name, "expected a facet, 'solid' or 'endsolid'")
            is_open = not is_open
        offset = match.end()
    if is_open:
        raise _broken(data, end, name, "the file ends before 'endsolid'")
    return corners


def _broken(data: bytes, offset: int, name: str, what: str) -> InputError:
    blank = len(data[offset:]) - len(data[offset:].lstrip())
    line = data.count(b"\n", 0, offset + blank) + 1
    return InputError(f"{name} is corrupt at line {line}: {what}.")
