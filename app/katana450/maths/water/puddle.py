"""What was spilled, in a few puddles that take in what falls beside them."""

from __future__ import annotations

import math
from typing import NamedTuple

from katana450.maths.geometry.vectors import Vector, add, scale
from katana450.maths.water.units import FEMTOLITRE

THICKNESS = 2.7e-3
"""[m] Of a large puddle that meets the table at 60 degrees: 2 sin(30 degrees) times the capillary
length of water (de Gennes, Brochard-Wyart, Quere, Capillarity and Wetting Phenomena, 2004)."""

MERGE_DISTANCE = 0.015
"""[m] So near to its edge water still runs into a puddle."""

MAX_PUDDLES = 8
"""Then water joins the nearest, however far."""


class Puddle(NamedTuple):
    """at: its middle in the base frame [m]; volume: [fl]."""

    at: Vector
    volume: int

    @property
    def radius(self) -> float:
        """[m] As a flat disc."""
        return math.sqrt(self.volume * FEMTOLITRE / (math.pi * THICKNESS))


def spill(puddles: tuple[Puddle, ...], point: Vector, volume: int) -> tuple[Puddle, ...]:
    """The puddles when ``volume`` [fl] more comes down on ``point`` [m]."""
    near = min(puddles, key=lambda puddle: math.dist(puddle.at, point), default=None)
    if near is None or (
        len(puddles) < MAX_PUDDLES and math.dist(near.at, point) > near.radius + MERGE_DISTANCE
    ):
        return (*puddles, Puddle(point, volume))
    fraction = volume / (near.volume + volume)
    middle = add(scale(1.0 - fraction, near.at), scale(fraction, point))
    joined = Puddle(middle, near.volume + volume)
    return tuple(joined if puddle is near else puddle for puddle in puddles)
