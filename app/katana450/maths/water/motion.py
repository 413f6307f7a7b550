"""The motion of vessels and of the water in them: the duration and the jerk of a cup."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.maths.water.flow import Water
from katana450.maths.water.vectors import Vector, norm, scale, sub


@dataclass(frozen=True)
class Course:
    """The motion of the cup so far.

    Attributes:
        duration: duration [s].
        peak_jerk: maximum jerk [m/s^3].
        acceleration: the last acceleration [m/s^2]; None before the first.
        at: time of that acceleration since the beginning [s].
        step: duration of the last step [s]; 0 before the first.
    """

    duration: float = 0.0
    peak_jerk: float = 0.0
    acceleration: Vector | None = None
    at: float = 0.0
    step: float = 0.0

    def after(self, acceleration: Vector, dt: float) -> Course:
        """Return the course ``dt`` [s] later, with the cup's ``acceleration`` [m/s^2].

        The acceleration is the difference of the mean velocities of this step and of the one
        before, over the time between their middles. With a constant jerk it is exact where
        ``at`` places it: a third of the difference of both steps after the border between them.
        """
        if dt <= 0.0:
            return self
        jerk, place = 0.0, self.duration + (dt - (self.step or dt)) / 3.0
        if self.acceleration is not None:
            jerk = norm(scale(1.0 / (place - self.at), sub(acceleration, self.acceleration)))
        return Course(self.duration + dt, max(self.peak_jerk, jerk), acceleration, place, dt)


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
