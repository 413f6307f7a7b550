"""The motion of vessels and of the water in them."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.maths.water.course import Course
from katana450.maths.water.flow import Water
from katana450.maths.water.vectors import Vector

NO_VELOCITY: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class VesselMotion:
    """The motion of a vessel so far, and position [m] and velocity [m/s] of its middle."""

    course: Course
    middle: Vector
    velocity: Vector = NO_VELOCITY


@dataclass(frozen=True, eq=False)
class MotionWithWater:
    """The water and the motion of each vessel.

    ``waited``: time [s] for which the films have still to drain, in vessels at rest.
    """

    water: Water
    motions: tuple[VesselMotion, ...]
    waited: float = 0.0

    @property
    def course(self) -> Course:
        """The motion history of the cup."""
        return self.motions[0].course

    @property
    def still(self) -> bool:
        """True if the water is at rest as long as no vessel moves, except for the films."""
        if self.water.parcels or any(vessel.velocity != NO_VELOCITY for vessel in self.motions):
            return False
        return all(
            vessel.slosh.lean == vessel.slosh.rate == (0.0, 0.0) for vessel in self.water.vessels
        )
