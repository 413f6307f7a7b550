"""Spilled water, in a few puddles that merge with water that falls beside them."""

from __future__ import annotations

import math
from typing import NamedTuple

from katana450.maths.water.units import FEMTOLITRE
from katana450.maths.water.vectors import Vector, add, scale

THICKNESS = 2.7e-3
"""Thickness [m] of a large puddle with a contact angle of 60 degrees: 2 sin(30 degrees) times the
capillary length of water (de Gennes, Brochard-Wyart, Quere, Capillarity and Wetting Phenomena,
2004).
"""

MERGE_DISTANCE = 0.015
"""Distance [m] from the edge of a puddle within which water runs into it."""

MAX_PUDDLES = 8
"""Maximum number of puddles; further water joins the nearest one."""


class Puddle(NamedTuple):
    """A puddle with its middle ``at`` in the base frame [m] and its ``volume`` [fl]."""

    at: Vector
    volume: int

    @property
    def radius(self) -> float:
        """The radius [m] of the puddle as a flat disc."""
        return math.sqrt(self.volume * FEMTOLITRE / (math.pi * THICKNESS))


def spill(puddles: tuple[Puddle, ...], point: Vector, volume: int) -> tuple[Puddle, ...]:
    """Return the puddles after ``volume`` [fl] more lands on ``point`` [m]."""
    near = min(puddles, key=lambda puddle: math.dist(puddle.at, point), default=None)
    if near is None or (
        len(puddles) < MAX_PUDDLES and math.dist(near.at, point) > near.radius + MERGE_DISTANCE
    ):
        return (*puddles, Puddle(point, volume))
    fraction = volume / (near.volume + volume)
    middle = add(scale(1.0 - fraction, near.at), scale(fraction, point))
    joined = Puddle(middle, near.volume + volume)
    return tuple(joined if puddle is near else puddle for puddle in puddles)
