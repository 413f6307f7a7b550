"""Letters as flat triangles, by the fonts DejaVu that come with matplotlib.

matplotlib is imported with the first letter. Its list of fonts, which takes seconds to make, is not
used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from katana450.maths.geometry.arrays import FloatArray

RESOLUTION = 32.0
"""Height of the font at which curves are divided into lines, to a fraction of one."""

STRIPS = 64.0
"""Number of strips of a font of height 1 into which letters are divided."""

FONTS = {
    "SERIF": ("Serif", "Italic"),
    "SANS": ("Sans", "Oblique"),
    "TYPEWRITER": ("SansMono", "Oblique"),
}
"""Families of the standard of VRML: name in DejaVu, and of the inclined style."""


@dataclass(frozen=True, eq=False)
class Letter:
    """A letter of a font of height 1.

    Attributes:
        triangles: (m, 3, 2) corners, counter-clockwise; x to the right from its origin, y up from
            the base line.
        advance: distance from its origin to that of the next letter.
    """

    triangles: FloatArray
    advance: float


@cache
def letter(sign: str, family: str, bold: bool, italic: bool) -> Letter | None:
    """Return a letter of a family in FONTS; None if the font does not have it."""
    from matplotlib.ft2font import LoadFlags
    from matplotlib.path import Path as Outlines

    font = _font(family, bold, italic)
    if not font.get_char_index(ord(sign)):
        return None
    glyph = font.load_char(ord(sign), LoadFlags.NO_HINTING)
    found = Outlines(*font.get_path()).to_polygons()
    outlines = [np.asarray(each, dtype=np.float64) / RESOLUTION for each in found]
    # The unit of an advance is 1/65536 of that of an outline.
    advance = glyph.linearHoriAdvance / 65536.0 / RESOLUTION
    return Letter(filled([_in_strips(each) for each in outlines]), advance)


@cache
def _font(family: str, bold: bool, italic: bool) -> Any:
    from matplotlib import get_data_path
    from matplotlib.ft2font import FT2Font

    name, inclined = FONTS[family]
    style = "Bold" * bold + inclined * italic
    file = f"DejaVu{name}{'-' if style else ''}{style}.ttf"
    font = FT2Font(str(Path(get_data_path(), "fonts", "ttf", file)))
    font.set_size(RESOLUTION, 72.0)
    return font


def _in_strips(outline: FloatArray) -> FloatArray:
    """Return an outline (k, 2) whose corners are at the edges of strips."""
    return np.column_stack((outline[:, 0], np.rint(outline[:, 1] * STRIPS) / STRIPS))


def filled(outlines: list[FloatArray]) -> FloatArray:
    """Return triangles (m, 3, 2) that fill closed outlines, each (k, 2), as fonts are filled.

    The plane is divided into strips at the height of each corner. The lines that cross a strip,
    from left to right, are the sides of trapezoids; a part is inside where outlines go round it.
    """
    if not outlines:
        return np.zeros((0, 3, 2))
    closed = [np.stack((each, np.roll(each, -1, axis=0)), axis=1) for each in outlines]
    lines = np.concatenate(closed)
    lines = lines[lines[:, 0, 1] != lines[:, 1, 1]]
    upward = np.where(lines[:, 0, 1] < lines[:, 1, 1], 1, -1)
    # From the lower to the upper end.
    lines = np.where((upward > 0)[:, None, None], lines, lines[:, ::-1])
    (x0, y0), (x1, y1) = lines[:, 0].T, lines[:, 1].T
    heights = np.unique(lines[:, :, 1])
    found: list[FloatArray] = []
    for low, high in pairwise(heights):
        crossing = np.flatnonzero((y0 <= low) & (y1 >= high))
        slope = (x1[crossing] - x0[crossing]) / (y1[crossing] - y0[crossing])
        at_low = x0[crossing] + slope * (low - y0[crossing])
        at_high = x0[crossing] + slope * (high - y0[crossing])
        order = np.argsort(at_low + at_high, kind="stable")
        inside = np.cumsum(upward[crossing][order]) != 0
        for left, right in zip(order[:-1][inside[:-1]], order[1:][inside[:-1]], strict=True):
            a, b = (at_low[left], low), (at_low[right], low)
            c, d = (at_high[right], high), (at_high[left], high)
            found.append(np.array(((a, b, c), (a, c, d))))
    triangles = np.concatenate((np.zeros((0, 3, 2)), *found))
    # At the top or bottom of a stroke two corners may be one.
    apart = (triangles != np.roll(triangles, 1, axis=1)).any(axis=2).all(axis=1)
    return np.asarray(triangles[apart])
