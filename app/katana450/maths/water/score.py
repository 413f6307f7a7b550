"""The score of carrying and emptying water."""

from __future__ import annotations

import math
from dataclasses import dataclass

from katana450.maths.geometry.vectors import Vector, norm, scale, sub
from katana450.maths.water.flow import Water
from katana450.maths.water.units import MILLILITRE


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
        jerk, at = 0.0, self.duration + (dt - (self.step or dt)) / 3.0
        if self.acceleration is not None:
            jerk = norm(scale(1.0 / (at - self.at), sub(acceleration, self.acceleration)))
        return Course(self.duration + dt, max(self.peak_jerk, jerk), acceleration, at, dt)


@dataclass(frozen=True)
class Score:
    """Where the water is, and how the cup was moved.

    Attributes:
        emptied_percent: part of all water that is in the basin [%]; NaN without water.
        in_cup_ml, in_basin_ml, in_air_ml, spilled_ml: volumes [ml].
        duration: duration of the motion [s].
        peak_jerk: maximum jerk of the cup [m/s^3].
    """

    emptied_percent: float
    in_cup_ml: float
    in_basin_ml: float
    in_air_ml: float
    spilled_ml: float
    duration: float
    peak_jerk: float


def score(water: Water, course: Course) -> Score:
    """Return the score of the present ``water`` after ``course``."""
    total = water.total
    return Score(
        emptied_percent=100.0 * water.basin / total if total else math.nan,
        in_cup_ml=water.cup / MILLILITRE,
        in_basin_ml=water.basin / MILLILITRE,
        in_air_ml=water.air / MILLILITRE,
        spilled_ml=water.spilled / MILLILITRE,
        duration=course.duration,
        peak_jerk=course.peak_jerk,
    )
