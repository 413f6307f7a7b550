"""Water in the air, in parcels that fly freely, and spilled, in a few puddles that merge.

A parcel flies in vacuum, so that its fall is exact, and lands where its middle does.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from katana450.maths.water.environment import Basin, WaterEnvironment
from katana450.maths.water.units import FEMTOLITRE, GRAVITY
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


class Parcel(NamedTuple):
    """The water that left the lip in one step.

    Attributes:
        volume: volume [fl].
        start, velocity: place [m] and velocity [m/s] of its last part at the lip, in the base
            frame.
        age: time since then [s].
        span: time that it took to leave [s]; its first part is ahead by this.
    """

    volume: int
    start: Vector
    velocity: Vector
    age: float
    span: float

    def at(self, age: float) -> Vector:
        """Return the place [m] at ``age`` [s]."""
        (x, y, z), (u, v, w) = self.start, self.velocity
        return x + u * age, y + v * age, z + (w - 0.5 * GRAVITY * age) * age

    def falls_to(self, z: float) -> float | None:
        """Return the age [s] at which it falls through the height ``z`` [m], or None."""
        w = self.velocity[2]
        square = w * w + 2.0 * GRAVITY * (self.start[2] - z)
        age = (w + math.sqrt(square)) / GRAVITY if square >= 0.0 else -1.0
        return age if age >= 0.0 else None


class Ground(Enum):
    """The surfaces on which water can land."""

    BASIN = "basin"
    TABLE = "table"
    FLOOR = "floor"


class Landing(NamedTuple):
    """The landing of a parcel: its ground, its age [s], and the place [m] of its middle."""

    ground: Ground
    age: float
    point: Vector


def landing(parcel: Parcel, water_environment: WaterEnvironment, level: float) -> Landing:
    """Return the landing of ``parcel``; the basin's water stands ``level`` [m] over its floor.

    The basin receives water that falls through the plane of its rim, inside the rim. Other vessels
    are ignored.
    """
    basin = water_environment.basin
    if _is_into(basin, parcel):
        age = parcel.falls_to(basin.at[2] + basin.floor + level) or 0.0
        return Landing(Ground.BASIN, age, parcel.at(age))
    age = parcel.falls_to(0.0) or 0.0
    x, y, _ = parcel.at(age)
    (west, east), (south, north) = water_environment.table.x, water_environment.table.y
    if parcel.start[2] >= 0.0 and west <= x <= east and south <= y <= north:
        return Landing(Ground.TABLE, age, (x, y, 0.0))
    age = parcel.falls_to(water_environment.table.floor) or 0.0
    x, y, _ = parcel.at(age)
    return Landing(Ground.FLOOR, age, (x, y, water_environment.table.floor))


def _is_into(basin: Basin, parcel: Parcel) -> bool:
    """Return whether the middle of ``parcel`` lands in ``basin``."""
    age = parcel.falls_to(basin.rim)
    if age is not None:
        x, y, _ = parcel.at(age)
        return math.hypot(x - basin.at[0], y - basin.at[1]) < basin.rim_radius
    # It never falls through the rim: it is in the basin only if it left its cup there.
    x, y, z = parcel.start
    height = z - basin.at[2] - basin.floor
    return height >= 0.0 and math.hypot(x - basin.at[0], y - basin.at[1]) < basin.radius(height)
