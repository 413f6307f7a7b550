"""Wavefront OBJ: vertices with their colours, and polygons.

Source: Alias|Wavefront, Advanced Visualizer manual, appendix B1. No other file is opened, even if
the file names one.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.surface import MeshReading, check_triangles, of_polygons

IGNORED_STATEMENTS = frozenset(
    [
        *("vt", "vn", "vp", "g", "o", "s", "mg", "usemap", "maplib", "bevel", "c_interp"),
        *("d_interp", "lod", "shadow_obj", "trace_obj"),
    ]
)
"""Statements that change no surface."""

LEFT_OUT = {
    "p": "points",
    "l": "lines",
    "call": "other files that it calls",
    "csh": "commands",
    "usemtl": "materials, which are in another file",
    "mtllib": "materials, which are in another file",
    **dict.fromkeys(
        [
            *("cstype", "deg", "bmat", "step", "curv", "curv2", "surf", "parm", "trim", "hole"),
            *("scrv", "sp", "end", "con", "res", "bzp", "bsp", "cdc", "cdp", "ctech", "stech"),
        ],
        "free-form curves and surfaces",
    ),
}
"""Statements that are not read, and their names in messages."""


def read_obj(data: bytes, name: str) -> MeshReading:
    """Return all polygons. Raises InputError with the line of an invalid statement."""
    found = _Lines(name)
    text = data.decode("utf-8", "replace").replace("\r\n", "\n").replace("\\\n", " ")
    for number, line in enumerate(text.split("\n"), 1):
        words = line.partition("#")[0].split()
        if words:
            found.take(words, number)
    return found.reading()


class _Lines:
    """The statements of a file, collected line by line."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._vertices: list[list[float]] = []
        self._colours: dict[int, list[float]] = {}
        self._corners: list[int] = []
        self._sizes: list[int] = []
        self._triangles = 0
        self._left_out: Counter[str] = Counter()

    def take(self, words: list[str], line: int) -> None:
        """Take the words of one statement. Raises InputError."""
        kind = words[0]
        if kind == "v":
            self._vertex(words[1:], line)
        elif kind == "f":
            self._face(words[1:], line)
        elif kind in LEFT_OUT:
            self._left_out[LEFT_OUT[kind]] += 1
        elif kind not in IGNORED_STATEMENTS:
            raise self._wrong(line, f"{kind[:20]!r} is not an OBJ statement")

    def reading(self) -> MeshReading:
        """Return the surface of all statements."""
        vertex_colours = None
        if self._colours:
            vertex_colours = np.full((len(self._vertices), 4), 0.8)
            vertex_colours[:, 3] = 1.0
            vertex_colours[list(self._colours), :3] = list(self._colours.values())
        surface = of_polygons(
            np.array(self._vertices, dtype=np.float64).reshape(-1, 3),
            np.array(self._corners, dtype=np.int64),
            np.array(self._sizes, dtype=np.int64),
            self._name,
            vertex_colours=vertex_colours,
        )
        return MeshReading(surface, tuple(self._left_out))

    def _vertex(self, words: list[str], line: int) -> None:
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            raise self._wrong(line, "the coordinates of a vertex must be numbers") from None
        # A fourth number is a weight; three more are a colour, an extension of many programs.
        if not (3 <= len(numbers) <= 8 and all(map(math.isfinite, numbers))):
            raise self._wrong(line, "a vertex must have three finite coordinates")
        if len(numbers) >= 6:
            self._colours[len(self._vertices)] = numbers[-3:] if len(numbers) == 7 else numbers[3:6]
        self._vertices.append(numbers[:3])

    def _face(self, words: list[str], line: int) -> None:
        count = len(self._vertices)
        for word in words:
            try:
                index = int(word.partition("/")[0])
            except ValueError:
                raise self._wrong(line, f"{word[:20]!r} is not a corner of a face") from None
            if index == 0 or not -count <= index < 1 << 31:
                raise self._wrong(line, f"there is no vertex {index}")
            self._corners.append(index - 1 if index > 0 else count + index)
        self._sizes.append(len(words))
        self._triangles += max(len(words) - 2, 0)
        check_triangles(self._triangles, self._name)

    def _wrong(self, line: int, what: str) -> InputError:
        return InputError(f"{self._name}, line {line}: {what}.")
