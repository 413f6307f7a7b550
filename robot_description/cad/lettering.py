"""Raised capitals and digits made of straight strokes, for the name on the arm; mm."""

from __future__ import annotations

import math
from itertools import pairwise

from manifold3d import CrossSection, Manifold

from robot_description.cad.outline import rectangle

Stroke = tuple[tuple[float, float], ...]

# Centre lines on a cell 4 wide and 6 high.
_STROKES: dict[str, tuple[Stroke, ...]] = {
    "A": (((0, 0), (2, 6), (4, 0)), ((0.7, 2), (3.3, 2))),
    "K": (((0, 0), (0, 6)), ((4, 6), (0, 2.4)), ((1.4, 3.6), (4, 0))),
    "N": (((0, 0), (0, 6), (4, 0), (4, 6)),),
    "T": (((2, 0), (2, 6)), ((0, 6), (4, 6))),
    "0": (((1, 0), (3, 0), (4, 1), (4, 5), (3, 6), (1, 6), (0, 5), (0, 1), (1, 0)),),
    "4": (((3, 0), (3, 6), (0, 2), (4, 2)),),
    "5": (((4, 6), (0.3, 6), (0, 3.5), (3, 3.5), (4, 2.6), (4, 1), (3, 0), (0, 0)),),
}
_CELL_WIDTH, _CELL_HEIGHT, _ADVANCE, _BLANK = 4.0, 6.0, 5.6, 3.0
_WEIGHT = 0.95


def _bar(start: tuple[float, float], end: tuple[float, float]) -> CrossSection:
    length, half = math.dist(start, end), _WEIGHT / 2
    turn = math.degrees(math.atan2(end[1] - start[1], end[0] - start[0]))
    bar = CrossSection([rectangle((-half, length + half), (-half, half))])
    return bar.rotate(turn).translate(start)


def width_of(text: str) -> float:
    """Return the width of ``text`` for letters 6 high."""
    steps = sum(_BLANK if letter == " " else _ADVANCE for letter in text)
    return steps - _ADVANCE + _CELL_WIDTH + _WEIGHT


def lettering(text: str, height: float, thick: float) -> Manifold:
    """Return ``text`` centred on the origin, reading along x, standing from z 0 to ``thick``.

    Raises
    ------
    ValueError
        A letter has no strokes.
    """
    unknown = sorted(set(text) - set(_STROKES) - {" "})
    if unknown:
        raise ValueError(f"no strokes for {unknown} in {text!r}: add them to lettering.py")
    flat = CrossSection()
    x = (_WEIGHT - width_of(text)) / 2
    for letter in text:
        for stroke in _STROKES.get(letter, ()):
            for start, end in pairwise(stroke):
                flat = flat + _bar(start, end).translate((x, -_CELL_HEIGHT / 2))
        x += _BLANK if letter == " " else _ADVANCE
    scale = height / _CELL_HEIGHT
    return flat.scale((scale, scale)).extrude(thick)
