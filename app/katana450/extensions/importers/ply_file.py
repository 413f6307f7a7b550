"""PLY, as text and as binary of either byte order.

Source: G. Turk, The PLY Polygon File Format (1994). Types by size, such as int32, come from later
programs.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.importers.surface import (
    MeshReading,
    as_bytes,
    check_triangles,
    doubles,
    of_polygons,
)
from katana450.maths.geometry.arrays import FloatArray

TYPES = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2"},
    **{"ushort": "u2", "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}
"""numpy types by their names in the header."""

ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
"""numpy byte orders by the formats in the header; empty for text."""

STATEMENTS = ("format", "element", "property")
"""First words of the lines of a header that matter."""

MAX_HEADER_BYTES = 64 * 1024
"""[bytes] Maximum size of a header."""

CORNERS = ("vertex_indices", "vertex_index")
"""Names of the property with the corners of a face."""

PAINT = ("red", "green", "blue", "alpha")
"""Names of the properties of a colour."""


@dataclass(frozen=True)
class Property:
    """A property of an element.

    Attributes:
        name: its name.
        numbers: numpy type of its values.
        counts: numpy type of the length of a list; None for a single number.
    """

    name: str
    numbers: str
    counts: str | None


@dataclass(frozen=True)
class Element:
    """An element of the header: a number of rows with the same properties."""

    name: str
    rows: int
    properties: list[Property] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class Column:
    """The values of a property: one per row, or a list per row of lengths ``sizes`` (rows,)."""

    values: npt.NDArray[Any]
    sizes: npt.NDArray[np.int64] | None
    numbers: str


def read_ply(data: bytes, name: str) -> MeshReading:
    """Return all faces. Raises InputError for an invalid file."""
    order, elements, body = _header(data, name)
    source = _Binary(body, order, name) if order else _Text(body, name)
    found: dict[str, dict[str, Column]] = {}
    for element in elements:
        try:
            found[element.name] = source.columns(element)
        except InputError:
            # Some programs declare elements after the faces that they do not write.
            if not found.keys() >= {"vertex", "face"}:
                raise
            break
    vertices, faces = found.get("vertex", {}), found.get("face", {})
    if not all(axis in vertices and vertices[axis].sizes is None for axis in "xyz"):
        raise InputError(f"{name} has no vertices with x, y and z.")
    points = np.column_stack([doubles(vertices[axis].values) for axis in "xyz"])
    listed = next((faces[key] for key in CORNERS if key in faces), None)
    if listed is None or listed.sizes is None:
        listed = Column(np.zeros(0), np.zeros(0, dtype=np.int64), "i4")
    assert listed.sizes is not None
    # Values that cannot be an index become -1, which `of_polygons` refuses.
    usable = np.abs(doubles(listed.values)) < 2.0**53
    corners = np.where(usable, listed.values, -1).astype(np.int64)
    strips = found.get("tristrips", {}).get("vertex_indices")
    if strips is not None and strips.sizes is not None and not len(corners):
        corners = _of_strips(strips.values.astype(np.int64), strips.sizes, name)
        listed = Column(corners, np.full(len(corners) // 3, 3), "i4")
        faces = {}
        elements = [each for each in elements if each.name != "tristrips"]
    assert listed.sizes is not None
    colours, of_vertices = _paint(faces), _paint(vertices)
    surface = of_polygons(
        points,
        corners,
        listed.sizes,
        name,
        None if colours is None else as_bytes(colours),
        vertex_colours=of_vertices if colours is None else None,
    )
    declared = next((each.rows for each in elements if each.name == "face"), 0)
    count, note = len(listed.sizes), ""
    if faces and count < declared:
        check_triangles(declared, name)
        note = f"The file ends after {count} of {declared} faces."
    others = [f"{e.rows} {e.name}" for e in elements if e.name not in ("vertex", "face") and e.rows]
    return MeshReading(surface, tuple(others), note=note)


def _of_strips(
    values: npt.NDArray[np.int64], sizes: npt.NDArray[np.int64], name: str
) -> npt.NDArray[np.int64]:
    """Return the corners (3 m,) of triangles in strips, which end with their list or with -1."""
    check_triangles(len(values), name)
    ends = np.zeros(len(values) + 1, dtype=bool)
    ends[np.cumsum(sizes)] = True
    # Number of each value within its strip; every second triangle has the other orientation.
    starts = ends[:-1] | np.concatenate(([True], values[:-1] < 0))
    first = np.maximum.accumulate(np.where(starts, np.arange(len(values)), 0))
    place = np.arange(len(values)) - first
    last = np.flatnonzero((place >= 2) & (values >= 0))
    odd = place[last] % 2
    return np.column_stack((values[last - 2 + odd], values[last - 1 - odd], values[last])).ravel()


def _header(data: bytes, name: str) -> tuple[str, list[Element], bytes]:
    """Return the byte order, the elements, and the data after the header."""
    if not re.match(rb"ply[ \t]*[\r\n]", data):
        raise InputError(f"{name} is not a PLY file: it must begin with 'ply'.")
    ends = re.compile(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r)").search(data, 0, MAX_HEADER_BYTES)
    if ends is None:
        raise InputError(f"{name} is corrupt: its header does not end.")
    order: str | None = None
    elements: dict[str, Element] = {}
    for line in data[: ends.start()].decode("utf-8", "replace").splitlines()[1:]:
        match line.split():
            # Some programs forget the word comment.
            case []:
                continue
            case [word, *_] if word not in STATEMENTS:
                continue
            case ["format", kind, "1.0"] if kind in ORDERS:
                order = ORDERS[kind]
                continue
            case ["element", kind, rows] if rows.isascii() and rows.isdigit() and len(rows) < 12:
                if kind not in elements:
                    elements[kind] = Element(kind, int(rows))
                    continue
            case ["property", numbers, kind] if elements and numbers in TYPES:
                _last(elements).properties.append(Property(kind, TYPES[numbers], None))
                continue
            case ["property", "list", counts, numbers, kind] if elements:
                if TYPES.get(counts, "f")[0] != "f" and numbers in TYPES:
                    listed = Property(kind, TYPES[numbers], TYPES[counts])
                    _last(elements).properties.append(listed)
                    continue
        raise InputError(f"{name} is corrupt: {line[:60]!r} in its header is invalid.")
    if order is None:
        raise InputError(f"{name} is corrupt: its header has no format.")
    return order, list(elements.values()), data[ends.end() :]


def _last(elements: dict[str, Element]) -> Element:
    return next(reversed(elements.values()))


def _paint(columns: dict[str, Column]) -> FloatArray | None:
    """Return colours (rows, 4) 0..1, scaled by the type of the numbers; None without colours."""
    found = [columns[key] for key in PAINT if key in columns and columns[key].sizes is None]
    if len(found) < 3:
        return None
    scales = [1.0 if each.numbers.startswith("f") else 255.0 for each in found]
    parts = [doubles(each.values) / scale for each, scale in zip(found, scales, strict=True)]
    parts += [np.ones(len(parts[0]))] * (4 - len(parts))
    return np.column_stack(parts)


class _Text:
    """The numbers after the header of a text file, row by row."""

    def __init__(self, body: bytes, name: str) -> None:
        self._name, self._at = name, 0
        try:
            self._numbers = np.array(list(map(float, body.split())), dtype=np.float64)
        except ValueError as error:
            raise InputError(f"{name} is corrupt: {str(error)[:80]}.") from error

    def columns(self, element: Element) -> dict[str, Column]:
        """Return the columns of ``element``, from the next rows."""
        plain = all(each.counts is None for each in element.properties)
        lengths = [1] * len(element.properties) if plain else self._lengths(element)
        if lengths is None:
            return _row_by_row(element, self._list)
        widths = [
            length + (each.counts is not None)
            for each, length in zip(element.properties, lengths, strict=True)
        ]
        rows = self._take(element.rows * sum(widths)).reshape(element.rows, sum(widths))
        found: dict[str, Column] = {}
        at = 0
        for each, length, width in zip(element.properties, lengths, widths, strict=True):
            block = rows[:, at + width - length : at + width].ravel()
            sizes = None if each.counts is None else np.full(element.rows, length)
            found[each.name] = Column(block, sizes, each.numbers)
            at += width
        return found

    def _lengths(self, element: Element) -> list[int] | None:
        """Return the number of values of each property, if it is equal in all rows; else None."""
        lengths: list[int] = []
        at = self._at
        for each in element.properties:
            if at >= len(self._numbers) or not element.rows:
                return None
            lengths.append(1 if each.counts is None else self._count(at))
            at += lengths[-1] + (each.counts is not None)
        width = at - self._at
        if self._at + width * element.rows > len(self._numbers):
            return None
        rows = self._numbers[self._at : self._at + width * element.rows].reshape(-1, width)
        at = 0
        for each, length in zip(element.properties, lengths, strict=True):
            if each.counts is not None and (rows[:, at] != length).any():
                return None
            at += length + (each.counts is not None)
        return lengths

    def _list(self, each: Property) -> FloatArray:
        """Return the next value or list of values."""
        count = 1 if each.counts is None else self._count(self._at)
        self._at += each.counts is not None
        return self._take(count)

    def _count(self, at: int) -> int:
        count = float(self._numbers[at]) if at < len(self._numbers) else -1.0
        if not (0.0 <= count <= len(self._numbers) and count == int(count)):
            raise InputError(f"{self._name} is corrupt: a list has no length, or the file ends.")
        return int(count)

    def _take(self, count: int) -> FloatArray:
        if self._at + count > len(self._numbers):
            raise InputError(f"{self._name} is corrupt: it ends too early.")
        self._at += count
        return self._numbers[self._at - count : self._at]


class _Binary:
    """The numbers after the header of a binary file, row by row."""

    def __init__(self, body: bytes, order: str, name: str) -> None:
        self._body, self._order, self._name, self._at = body, order, name, 0

    def columns(self, element: Element) -> dict[str, Column]:
        """Return the columns of ``element``, from the next rows."""
        if not (element.rows and element.properties):
            return {each.name: _column(each, []) for each in element.properties}
        start = self._at
        first = [self._list(each) for each in element.properties]
        self._at = start
        fields: list[tuple[str, str, tuple[int, ...]]] = []
        for number, (each, row) in enumerate(zip(element.properties, first, strict=True)):
            if each.counts is not None:
                fields.append((f"count {number}", self._order + each.counts, ()))
            shape = () if each.counts is None else (len(row),)
            fields.append((f"value {number}", self._order + each.numbers, shape))
        kind = np.dtype(fields)
        if kind.itemsize * element.rows <= len(self._body) - start:
            rows = np.frombuffer(self._body, kind, element.rows, start)
            counted = [n for n, each in enumerate(element.properties) if each.counts is not None]
            if all((rows[f"count {n}"] == len(first[n])).all() for n in counted):
                self._at += kind.itemsize * element.rows
                return {
                    each.name: Column(
                        rows[f"value {n}"].ravel(),
                        None if each.counts is None else np.full(element.rows, len(first[n])),
                        each.numbers,
                    )
                    for n, each in enumerate(element.properties)
                }
        return _row_by_row(element, self._list)

    def _list(self, each: Property) -> npt.NDArray[Any]:
        """Return the next value or list of values."""
        count = 1 if each.counts is None else int(self._take(each.counts, 1)[0])
        return self._take(each.numbers, count)

    def _take(self, numbers: str, count: int) -> npt.NDArray[Any]:
        kind = np.dtype(self._order + numbers)
        if not 0 <= count * kind.itemsize <= len(self._body) - self._at:
            raise InputError(f"{self._name} is corrupt: it ends too early.")
        self._at += count * kind.itemsize
        return np.frombuffer(self._body, kind, count, self._at - count * kind.itemsize)


def _row_by_row(
    element: Element, take: Callable[[Property], npt.NDArray[Any]]
) -> dict[str, Column]:
    """Return the columns of ``element``; ``take`` returns the next value or list of values.

    Of a file that ends among its faces, those before are returned.
    """
    values: list[list[npt.NDArray[Any]]] = [[] for _ in element.properties]
    for number in range(element.rows):
        try:
            row = [take(each) for each in element.properties]
        except InputError:
            if element.name != "face" or not number:
                raise
            break
        for value, rows in zip(row, values, strict=True):
            rows.append(value)
    return {
        each.name: _column(each, rows)
        for each, rows in zip(element.properties, values, strict=True)
    }


def _column(each: Property, rows: list[npt.NDArray[Any]]) -> Column:
    sizes = None if each.counts is None else np.array([len(row) for row in rows], dtype=np.int64)
    return Column(np.concatenate(rows) if rows else np.zeros(0), sizes, each.numbers)
