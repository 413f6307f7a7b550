"""Wavefront OBJ: vertices with their colours, and polygons with their materials.

Source: Alias|Wavefront, Advanced Visualizer manual, appendix B1. Materials are those of the MTL
files of the same upload.
"""

from __future__ import annotations

import codecs
import math
from collections import Counter

import numpy as np

from katana450.errors import InputError
from katana450.extensions.importers.archive import Companions
from katana450.extensions.importers.formats.surface import (
    MeshReading,
    as_bytes,
    check_triangles,
    of_polygons,
)

Material = tuple[float, float, float, float]
"""Diffuse colour and opacity 0..1."""

PLAIN: Material = (0.8, 0.8, 0.8, 1.0)
"""A material without a colour."""


def read_mtl(text: str) -> tuple[dict[str, Material], bool]:
    """Return the materials by their names, and whether any has pictures.

    Lines that are no MTL are ignored, because a surface without its colours is still a surface.
    """
    materials: dict[str, Material] = {}
    name, has_pictures = None, False
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if len(words) < 2:
            continue
        kind = words[0].lower()
        if kind == "newmtl":
            name = line.split(None, 1)[1].strip()
            materials[name] = PLAIN
        elif name is not None and kind in ("kd", "d", "tr"):
            numbers = _numbers(words[1:])
            red, green, blue, opacity = materials[name]
            if kind == "kd" and numbers:
                # A single number stands for grey.
                red, green, blue = numbers[:3] if len(numbers) >= 3 else (numbers[0],) * 3
            elif numbers:
                opacity = numbers[-1] if kind == "d" else 1.0 - numbers[-1]
            materials[name] = (red, green, blue, opacity)
        has_pictures |= kind.startswith("map_")
    return materials, has_pictures


def _numbers(words: list[str]) -> list[float]:
    """Return the finite numbers among ``words``, such as those after the option -halo."""
    numbers: list[float] = []
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError:
            continue
    return [number for number in numbers if math.isfinite(number)]


FREE_FORM = """
cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con res bzp bsp cdc cdp ctech stech
"""

NO_SURFACE = """
vt vn vp g o s mg usemap maplib bevel c_interp d_interp lod shadow_obj trace_obj
"""

LEFT_OUT = {
    **dict.fromkeys(NO_SURFACE.split(), ""),
    **dict.fromkeys(FREE_FORM.split(), "free-form curves and surfaces"),
    **{"p": "points", "l": "lines", "call": "other files that it calls", "csh": "commands"},
}
"""Statements that are not read, and their names in messages; empty if they change no surface."""


def read_obj(data: bytes, name: str, companions: Companions | None = None) -> MeshReading:
    """Return all polygons. Raises InputError with the line of an invalid statement."""
    lines = _Lines(name, companions or Companions())
    text = plain_text(data).replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")
    for number, line in enumerate(text.split("\n"), 1):
        words = line.partition("#")[0].split()
        if words:
            lines.take(words, number)
    return lines.reading()


def plain_text(data: bytes) -> str:
    """Return a text in UTF-8, or in UTF-16 if it begins with the mark of its byte order."""
    is_wide = data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    return data.decode("utf-16" if is_wide else "utf-8", "replace").removeprefix("\ufeff")


class _Lines:
    """The statements of a file, collected line by line."""

    def __init__(self, name: str, companions: Companions) -> None:
        self._name, self._companions = name, companions
        self._materials: dict[str, Material] = {}
        self._paints: list[Material] = []
        self._paint = PLAIN
        self._read: set[str] = set()
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
        elif kind == "usemtl":
            self._paint = self._materials.get(" ".join(words[1:]), PLAIN)
        elif kind == "mtllib":
            self._library(words[1:])
        elif LEFT_OUT.get(kind):
            self._left_out[LEFT_OUT[kind]] += 1
        elif kind not in LEFT_OUT:
            raise self._wrong(line, f"{kind[:20]!r} is not an OBJ statement")

    def reading(self) -> MeshReading:
        """Return the surface of all statements."""
        vertex_colours = None
        if self._colours:
            vertex_colours = np.full((len(self._vertices), 4), 0.8)
            vertex_colours[:, 3] = 1.0
            vertex_colours[list(self._colours), :3] = list(self._colours.values())
        colours = None
        if any(paint != PLAIN for paint in self._paints):
            colours = as_bytes(np.array(self._paints))
        surface = of_polygons(
            np.array(self._vertices, dtype=np.float64).reshape(-1, 3),
            np.array(self._corners, dtype=np.int64),
            np.array(self._sizes, dtype=np.int64),
            self._name,
            colours,
            vertex_colours=vertex_colours,
        )
        return MeshReading(surface, tuple(self._left_out))

    def _library(self, words: list[str]) -> None:
        """Read the materials of the MTL files ``words``, or of one whose name has blanks."""
        whole = " ".join(words)
        is_list = all(word.lower().endswith(".mtl") for word in words)
        for name in words if is_list else [whole]:
            companion = self._companions.find([name])
            if companion is None or companion[0] in self._read:
                continue
            self._read.add(companion[0])
            materials, has_pictures = read_mtl(plain_text(companion[1]))
            self._materials |= materials
            if has_pictures:
                self._left_out["pictures on the surface"] += 1

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
        self._paints.append(self._paint)
        self._triangles += max(len(words) - 2, 0)
        check_triangles(self._triangles, self._name)

    def _wrong(self, line: int, what: str) -> InputError:
        return InputError(f"{self._name}, line {line}: {what}.")
