"""Raised letters and digits made of mitred strokes, for the name on the arm; mm."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from manifold3d import CrossSection, FillRule, Manifold
from numpy.typing import NDArray

from robot_description.cad.outline import on_grid

Stroke = tuple[tuple[float, float], ...]


def _arc(
    centre: tuple[float, float], radii: tuple[float, float], start: float, end: float, count: int
) -> Stroke:
    """Return ``count`` + 1 points of an ellipse from ``start`` to ``end`` degrees."""
    angles = [math.radians(start + (end - start) * k / count) for k in range(count + 1)]
    return tuple(
        (centre[0] + radii[0] * math.cos(a), centre[1] + radii[1] * math.sin(a)) for a in angles
    )


# Width and centre lines of each letter: capitals and digits are 6 high, small letters 4.2. A stroke
# that ends where it starts is closed.
_STROKES: dict[str, tuple[float, tuple[Stroke, ...]]] = {
    "A": (4.0, (((0, 0), (2, 6), (4, 0)), ((0.7, 2), (3.3, 2)))),
    "K": (4.0, (((0, 0), (0, 6)), ((4, 6), (0, 2.4)), ((1.4, 3.6), (4, 0)))),
    "N": (4.0, (((0, 0), (0, 6), (4, 0), (4, 6)),)),
    "T": (4.0, (((2, 0), (2, 6)), ((0, 6), (4, 6)))),
    "a": (3.2, (_arc((1.55, 2.1), (1.55, 2.1), 0, 360, 12), ((3.1, 4.2), (3.1, 0)))),
    "k": (3.0, (((0, 0), (0, 6)), ((2.9, 4.2), (0, 1.7)), ((1.1, 2.6), (3.0, 0)))),
    "n": (2.9, (((0, 0), (0, 4.2)), (*_arc((1.45, 2.5), (1.45, 1.7), 170, 0, 6), (2.9, 0)))),
    "t": (
        2.3,
        (
            ((0.8, 5.6), *_arc((1.7, 0.9), (0.9, 0.9), 180, 270, 4), (2.3, 0)),
            ((0, 4.2), (2.2, 4.2)),
        ),
    ),
    "0": (3.5, (_arc((1.75, 3.0), (1.75, 3.0), 0, 360, 14),)),
    "4": (3.6, (((2.7, 0), (2.7, 6)), ((2.7, 6), (0, 1.9), (3.6, 1.9)))),
    "5": (
        3.4,
        (((3.2, 6), (0.5, 6), (0.2, 3.2), *_arc((1.6, 1.95), (1.8, 1.95), 120, -135, 8)),),
    ),
}
_HEIGHT, _GAP, _BLANK = 6.0, 1.55, 3.0
_WEIGHT = 1.0
_SLANT = 0.16  # sideways for each mm of height


def _line(stroke: Stroke) -> CrossSection:
    """Return ``stroke`` with the weight of the letters and mitred bends."""
    path: NDArray[np.float64] = np.array(stroke, dtype=np.float64)
    closed = math.dist(stroke[0], stroke[-1]) < 1e-9
    side = np.diff(path, axis=0)
    side /= np.sqrt((side * side).sum(axis=1))[:, None]
    left = np.column_stack((-side[:, 1], side[:, 0]))
    before = np.vstack((left[-1:] if closed else left[:1], left))
    after = np.vstack((left, left[:1] if closed else left[-1:]))
    # The mitre of a sharp bend is limited, because it would be a spike.
    mitre = (before + after) / np.maximum(1.0 + (before * after).sum(axis=1), 0.75)[:, None]
    if not closed:
        path[0] -= side[0] * _WEIGHT / 2
        path[-1] += side[-1] * _WEIGHT / 2
    one, other = path + mitre * _WEIGHT / 2, path - mitre * _WEIGHT / 2
    if closed:
        return CrossSection([on_grid(one[:-1]), on_grid(other[:-1])], FillRule.EvenOdd)
    return CrossSection([on_grid(np.vstack((one, other[::-1])))], FillRule.NonZero)


def _widths(text: str) -> list[float]:
    return [_BLANK if letter == " " else _STROKES[letter][0] + _GAP for letter in text]


def width_of(text: str) -> float:
    """Return the width of ``text`` for letters 6 high."""
    return sum(_widths(text)) - _GAP + _WEIGHT


def _slanted(sections: Sequence[CrossSection]) -> CrossSection:
    flat = CrossSection()
    for section in sections:
        flat = flat + section
    return flat.transform(np.array([[1.0, _SLANT, 0.0], [0.0, 1.0, 0.0]]))


def lettering(text: str, height: float, thick: float) -> Manifold:
    """Return ``text`` centred on the origin, reading along x, from z 0 to ``thick``.

    Raises:
        ValueError: a letter has no strokes.
    """
    unknown = sorted(set(text) - set(_STROKES) - {" "})
    if unknown:
        raise ValueError(f"no strokes for {unknown} in {text!r}: add them to lettering.py")
    x = (_WEIGHT - width_of(text)) / 2
    sections = []
    for letter, width in zip(text, _widths(text), strict=True):
        if letter != " ":
            strokes = _STROKES[letter][1]
            sections += [_line(stroke).translate((x, -_HEIGHT / 2)) for stroke in strokes]
        x += width
    scale = height / _HEIGHT
    return _slanted(sections).scale((scale, scale)).extrude(thick)


def wrapped(text: str, height: float, thick: float, radius: float) -> Manifold:
    """Return ``text`` bent around the axis z, centred on +x at z 0, raised from ``radius``."""

    def bend(points: NDArray[np.float64]) -> NDArray[np.float64]:
        angle, reach = points[:, 0] / radius, radius + points[:, 2]
        return on_grid(
            np.column_stack((reach * np.cos(angle), reach * np.sin(angle), points[:, 1]))
        )

    return lettering(text, height, thick).warp_batch(bend)
