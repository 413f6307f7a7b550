"""Water in the air: parcels in free flight, and their landing places."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

from katana450.maths.geometry.vectors import Vector
from katana450.maths.water.environment import Basin, WaterEnvironment
from katana450.maths.water.units import GRAVITY


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
    """The landing of a parcel: on which ground, at which age [s] and at which point [m]."""

    ground: Ground
    age: float
    point: Vector


def landing(parcel: Parcel, water_environment: WaterEnvironment, level: float) -> Landing:
    """Return the landing of ``parcel``; the basin's water stands ``level`` [m] over its floor.

    The basin receives water that falls through the plane of its rim, inside the rim. The cup is
    ignored.
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
    """Return True if ``parcel`` lands in ``basin``."""
    age = parcel.falls_to(basin.rim)
    if age is not None:
        x, y, _ = parcel.at(age)
        return math.hypot(x - basin.at[0], y - basin.at[1]) < basin.rim_radius
    # It never falls through the rim: it is in the basin only if it left its cup there.
    x, y, z = parcel.start
    height = z - basin.at[2] - basin.floor
    inside = math.hypot(x - basin.at[0], y - basin.at[1]) < basin.radius(height)
    return height >= 0.0 and inside
