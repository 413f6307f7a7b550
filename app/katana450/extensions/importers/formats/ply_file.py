"""PLY, as text and as binary of either byte order.

Source: G. Turk, The PLY Polygon File Format (1994). Types by size, such as int32, come from later
programs.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.importers.formats.surface import (
    MeshReading,
    as_bytes,
    doubles,
    of_polygons,
)
from katana450.maths.geometry.arrays import FloatArray, IntArray

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


class Property(NamedTuple):
    """A property of an element.

    Attributes:
        name: its name.
        numbers: numpy type of its values.
        counts: numpy type of the length of a list; None for a single number.
    """

    name: str
    numbers: str
    counts: str | None = None


class Element(NamedTuple):
    """An element of the header: a number of rows with the same properties."""

    name: str
    rows: int
    properties: list[Property]


class Column(NamedTuple):
    """The values of a property: one per row, or a list per row of lengths ``sizes`` (rows,)."""

    values: npt.NDArray[Any]
    sizes: IntArray | None
    numbers: str


def read_ply(data: bytes, name: str) -> MeshReading:
    """Return all faces. Raises InputError for an invalid file."""
    order, elements, body = _header(data, name)
    numbers = _Numbers(body, order, name)
    tables: dict[str, dict[str, Column]] = {}
    for element in elements:
        # Some programs declare elements after the faces that they do not write.
        if tables.keys() >= {"vertex", "face"}:
            break
        tables[element.name] = numbers.columns(element)
    vertices, faces = tables.get("vertex", {}), tables.get("face", {})
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
    colours, of_vertices = _paint(faces), _paint(vertices)
    surface = of_polygons(
        points,
        corners,
        listed.sizes,
        name,
        None if colours is None else as_bytes(colours),
        vertex_colours=of_vertices if colours is None else None,
    )
    others = [f"{e.rows} {e.name}" for e in elements if e.name not in ("vertex", "face") and e.rows]
    return MeshReading(surface, tuple(others))


def _header(data: bytes, name: str) -> tuple[str, list[Element], bytes]:
    """Return the byte order, the elements, and the data after the header."""
    if not re.match(rb"ply[ \t]*[\r\n]", data):
        raise InputError(f"{name} is not a PLY file: it must begin with 'ply'.")
    ends = re.compile(rb"[\r\n]end_header[ \t]*(\r\n|\n|\r)").search(data, 0, MAX_HEADER_BYTES)
    if ends is None:
        raise InputError(f"{name} is corrupt: its header does not end.")
    order: str | None = None
    elements: dict[str, Element] = {}
    properties: list[Property] = []
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
                    properties = []
                    elements[kind] = Element(kind, int(rows), properties)
                    continue
            case ["property", numbers, kind] if elements and numbers in TYPES:
                properties.append(Property(kind, TYPES[numbers]))
                continue
            case ["property", "list", counts, numbers, kind] if elements:
                if TYPES.get(counts, "f")[0] != "f" and numbers in TYPES:
                    properties.append(Property(kind, TYPES[numbers], TYPES[counts]))
                    continue
        raise InputError(f"{name} is corrupt: {line[:60]!r} in its header is invalid.")
    if order is None:
        raise InputError(f"{name} is corrupt: its header has no format.")
    return order, list(elements.values()), data[ends.end() :]


def _paint(columns: dict[str, Column]) -> FloatArray | None:
    """Return colours (rows, 4) 0..1, scaled by the type of the numbers; None without colours."""
    paint = [columns[key] for key in PAINT if key in columns and columns[key].sizes is None]
    if len(paint) < 3:
        return None
    parts = [doubles(part.values) / (1.0 if part.numbers[0] == "f" else 255.0) for part in paint]
    return np.column_stack([*parts, np.ones(len(parts[0]))][:4])


class _Numbers:
    """The numbers after the header. Those of a text become doubles, so that both are read alike."""

    def __init__(self, body: bytes, order: str, name: str) -> None:
        self._body, self._order, self._name, self._at = body, order, name, 0
        if not order:
            try:
                self._body = np.array(list(map(float, body.split())), dtype=np.float64).tobytes()
            except ValueError as error:
                raise InputError(f"{name} is corrupt: {str(error)[:80]}.") from error

    def columns(self, element: Element) -> dict[str, Column]:
        """Return the columns of ``element``, from the next rows."""
        properties = element.properties
        if not (element.rows and properties):
            empty = np.zeros(0, dtype=np.int64)
            return {
                column.name: Column(empty, None if column.counts is None else empty, column.numbers)
                for column in properties
            }
        columns = self._alike(element)
        if columns is not None:
            return columns
        rows = [[self._next(column) for column in properties] for _ in range(element.rows)]
        return {
            column.name: Column(
                np.concatenate(values),
                None if column.counts is None else np.array([len(row) for row in values]),
                column.numbers,
            )
            for column, values in zip(properties, zip(*rows, strict=True), strict=True)
        }

    def _alike(self, element: Element) -> dict[str, Column] | None:
        """Return the columns if the lists of all rows are as long as those of the first row."""
        start = self._at
        lengths = [len(self._next(column)) for column in element.properties]
        self._at = start
        fields: list[tuple[Any, ...]] = []
        for n, (column, length) in enumerate(zip(element.properties, lengths, strict=True)):
            if column.counts is not None:
                fields.append((f"count {n}", self._kind(column.counts)))
            fields.append((f"value {n}", self._kind(column.numbers), (length,)))
        kind = np.dtype(fields)
        if kind.itemsize * element.rows > len(self._body) - start:
            return None
        table = np.frombuffer(self._body, kind, element.rows, start)
        columns: dict[str, Column] = {}
        for n, (column, length) in enumerate(zip(element.properties, lengths, strict=True)):
            sizes = None if column.counts is None else np.full(element.rows, length)
            if sizes is not None and (table[f"count {n}"] != length).any():
                return None
            columns[column.name] = Column(table[f"value {n}"].ravel(), sizes, column.numbers)
        self._at += kind.itemsize * element.rows
        return columns

    def _next(self, column: Property) -> npt.NDArray[Any]:
        """Return the next value or list of values."""
        count = 1.0
        if column.counts is not None:
            count = float(self._take(column.counts, 1)[0])
            if not (0.0 <= count <= len(self._body) and count == int(count)):
                raise InputError(f"{self._name} is corrupt: a list has no length.")
        return self._take(column.numbers, int(count))

    def _take(self, numbers: str, count: int) -> npt.NDArray[Any]:
        kind = self._kind(numbers)
        if count * kind.itemsize > len(self._body) - self._at:
            raise InputError(f"{self._name} is corrupt: it ends too early.")
        self._at += count * kind.itemsize
        return np.frombuffer(self._body, kind, count, self._at - count * kind.itemsize)

    def _kind(self, numbers: str) -> np.dtype[Any]:
        return np.dtype(self._order + numbers if self._order else np.float64)
