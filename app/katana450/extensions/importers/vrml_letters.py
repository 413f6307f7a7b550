"""Texts of VRML97 and X3D as flat letters.

Source: ISO/IEC 14772-1:1997, 6.22 FontStyle, 6.47 Text, which leave the fonts to the program.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from katana450.errors import InputError
from katana450.extensions.export.vrml_node import Node
from katana450.extensions.importers.letters import FONTS, Letter, letter
from katana450.extensions.importers.surface import MeshSurface, check_triangles
from katana450.extensions.importers.vrml_solids import flag, number, numbers, part, texts
from katana450.maths.geometry.arrays import FloatArray

MAX_LETTERS = 10_000
"""Maximum number of letters of a text."""

ASCENT = 0.8
"""[1] Fraction of the height of a line that is above its base line."""


@dataclass(frozen=True)
class Style:
    """The fields of a FontStyle; ``major`` and ``minor`` are its justification."""

    family: str
    style: str
    size: float
    spacing: float
    major: str
    minor: str
    horizontal: bool
    to_right: bool
    downwards: bool

    @classmethod
    def of(cls, node: Node) -> Style:
        """Return the style that a node FontStyle gives."""
        families = [each.upper() for each in texts(node.get("family"))]
        major, minor = ([each.upper() for each in texts(node.get("justify"))] + ["", ""])[:2]
        return cls(
            family=next((each for each in families if each in FONTS), "SERIF"),
            style=" ".join(texts(node.get("style"))).upper(),
            size=number(node, "size", 1.0),
            spacing=number(node, "spacing", 1.0),
            major=major,
            minor=minor,
            horizontal=flag(node, "horizontal"),
            to_right=flag(node, "leftToRight"),
            downwards=flag(node, "topToBottom"),
        )

    def letters(self, row: str, left_out: Counter[str]) -> list[Letter]:
        """Return the letters of a row; those that the font does not have are left out."""
        found: list[Letter] = []
        for sign in row:
            shown = sign if sign.isprintable() else " "
            each = letter(shown, self.family, "BOLD" in self.style, "ITALIC" in self.style)
            if each is None:
                left_out["letters that the font does not have"] += 1
            else:
                found.append(each)
        return found


def text(node: Node, name: str, left_out: Counter[str]) -> MeshSurface:
    """Return the letters of a Text in the plane z = 0, to be seen from the front."""
    rows = texts(node.get("string"))
    if sum(map(len, rows)) > MAX_LETTERS:
        raise InputError(f"{name} has a text of more than {MAX_LETTERS} letters.")
    style = Style.of(part(node, "fontStyle") or Node("FontStyle"))
    letters = [style.letters(row, left_out) for row in rows]
    steps = [_steps(row, style) for row in letters]
    stretches = _stretches(node, np.array([float(row.sum()) for row in steps]))
    found = [np.zeros((0, 3, 2))]
    for place, (row, step, stretch) in enumerate(zip(letters, steps, stretches, strict=True)):
        origins = _origins(step * stretch, place, len(rows), style)
        wide = (stretch, 1.0) if style.horizontal else (1.0, stretch)
        check_triangles(sum(map(len, found)) + sum(len(each.triangles) for each in row), name)
        found += [
            each.triangles * (style.size * np.array(wide)) + origin
            for each, origin in zip(row, origins, strict=True)
        ]
    corners = np.concatenate(found).reshape(-1, 2)
    if not len(corners):
        left_out["Text without letters"] += 1
    vertices = np.column_stack((corners, np.zeros(len(corners))))
    return MeshSurface(vertices, np.arange(len(corners)).reshape(-1, 3))


def _steps(row: list[Letter], style: Style) -> FloatArray:
    """Return the length (k,) of each letter along its row."""
    return style.size * np.array([each.advance if style.horizontal else 1.0 for each in row])


def _stretches(node: Node, widths: FloatArray) -> FloatArray:
    """Return the factor (n,) by which each row is stretched along itself."""
    wanted = np.zeros(len(widths))
    lengths = numbers(node, "length", ())[: len(widths), 0]
    wanted[: len(lengths)] = lengths
    factors = np.where((wanted > 0.0) & (widths > 0.0), wanted / np.maximum(widths, 1e-300), 1.0)
    longest = float((factors * widths).max(initial=0.0))
    maximum = number(node, "maxExtent", 0.0)
    return factors * (maximum / longest) if 0.0 < maximum < longest else factors


def _origins(steps: FloatArray, place: int, count: int, style: Style) -> FloatArray:
    """Return the origins (k, 2) of the letters of row ``place`` of ``count``."""
    begins, whole = np.cumsum(steps) - steps, float(steps.sum())
    along = begins - {"MIDDLE": 0.5, "END": 1.0}.get(style.major, 0.0) * whole
    across = style.size * style.spacing
    if style.horizontal:
        x = along if style.to_right else -along - steps
        # Base lines from that of the first row on, and the upper and lower end of all rows.
        y = -across * place if style.downwards else across * place
        ends = (0.0, -across * (count - 1)) if style.downwards else (across * (count - 1), 0.0)
        high, low = ends[0] + ASCENT * style.size, ends[1] - (1.0 - ASCENT) * style.size
        first, last = (high, low) if style.downwards else (low, high)
        y -= {"BEGIN": first, "MIDDLE": 0.5 * (high + low), "END": last}.get(style.minor, 0.0)
        return np.column_stack((x, np.full(len(x), y)))
    y_letters = -along - ASCENT * style.size if style.downwards else along
    column = across * (place - {"MIDDLE": 0.5, "END": 1.0}.get(style.minor, 0.0) * count)
    x_column = column if style.to_right else -column - across
    return np.column_stack((np.full(len(y_letters), x_column), y_letters))
