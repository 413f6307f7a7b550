"""The score of carrying and emptying a cup."""

from __future__ import annotations

import math
from dataclasses import dataclass

from katana450.maths.water.course import Course
from katana450.maths.water.flow import Water
from katana450.maths.water.units import MILLILITRE


@dataclass(frozen=True)
class Score:
    """Where the water is, and how the cup was moved.

    Attributes:
        emptied_percent: part of all water that is in the basin [%]; NaN without water.
        in_cup_ml: volume in the cup and on its wall [ml].
        in_basin_ml, in_air_ml, spilled_ml: volumes [ml].
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
        in_cup_ml=water.cup.kept / MILLILITRE,
        in_basin_ml=water.basin / MILLILITRE,
        in_air_ml=water.air / MILLILITRE,
        spilled_ml=water.spilled / MILLILITRE,
        duration=course.duration,
        peak_jerk=course.peak_jerk,
    )
