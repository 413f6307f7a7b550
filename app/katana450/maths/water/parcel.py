"""Water in the air, in parcels that fly as thrown stones do, and where they come down."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from katana450.maths.geometry.vectors import Vector
from katana450.maths.water.environment import Basin, WaterEnvironment
from katana450.maths.water.units import GRAVITY


class Parcel(NamedTuple):
    """What left the lip in one step.

    volume: [fl]. start, velocity: of its last bit as it left, [m] and [m/s] in the base frame. age:
    how long ago that was [s]. span: how long it took to leave [s], so that its first bit is ahead.
    """

    volume: int
    start: Vector
    velocity: Vector
    age: float
    span: float

    def at(self, age: float) -> Vector:
        """Where it is [m] at ``age`` [s]."""
        (x, y, z), (u, v, w) = self.start, self.velocity
        return x + u * age, y + v * age, z + (w - 0.5 * GRAVITY * age) * age

    def falls_to(self, z: float) -> float | None:
        """At what age [s] it comes down through the height ``z`` [m]; None if it never does."""
        w = self.velocity[2]
        square = w * w + 2.0 * GRAVITY * (self.start[2] - z)
        age = (w + math.sqrt(square)) / GRAVITY if square >= 0.0 else -1.0
        return age if age >= 0.0 else None


class Ground(Enum):
    """What water can come down on."""

    BASIN = "basin"
    TABLE = "table"
    FLOOR = "floor"


class Landing(NamedTuple):
    """On what, at what age [s] and where [m]."""

    ground: Ground
    age: float
    point: Vector


def landing(parcel: Parcel, water_environment: WaterEnvironment, level: float) -> Landing:
    """Where ``parcel`` comes down; in the basin the water stands ``level`` [m] over its floor.

    The basin gets what comes down through the plane of its rim inside it. The cup is not looked at.
    """
    basin = water_environment.basin
    if _into(basin, parcel):
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


def _into(basin: Basin, parcel: Parcel) -> bool:
    age = parcel.falls_to(basin.rim)
    if age is not None:
        x, y, _ = parcel.at(age)
        return math.hypot(x - basin.at[0], y - basin.at[1]) < basin.rim_radius
    # It never comes down through the rim: in the basin only if it left its cup there.
    x, y, z = parcel.start
    height = z - basin.at[2] - basin.floor
    inside = math.hypot(x - basin.at[0], y - basin.at[1]) < basin.radius(height)
    return height >= 0.0 and inside
