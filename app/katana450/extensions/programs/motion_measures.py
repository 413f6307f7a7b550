"""Measures of a motion and of its water that need no plan: of simulated and recorded runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.pouring import MotionWithWater
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.velocity import singular_values
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


def motion_measures(
    arm: ArmModel, tools: Sequence[str], q: FloatArray, qd: FloatArray
) -> dict[str, float]:
    """Return the measures of the joints by their names in ``measures.MEASURES``.

    Args:
        arm: the arm.
        tools: (N,) the tool frame.
        q: (N, n) joints [rad].
        qd: (N, n) rates [rad/s].
    """
    chains = [arm.chain_to(tool) for tool in tools]
    limits = arm.chain
    room = np.minimum(q - limits.lower, limits.upper - q)
    singular = [singular_values(chain, row)[-1] for chain, row in zip(chains, q, strict=True)]
    rows = zip(tools, q, qd, strict=True)
    speeds = [arm.kinematics_to(tool).tool_speed(*each) for tool, *each in rows]
    return {
        "smallest_singular_value": float(min(singular)),
        "margin_to_limits_deg": float(np.degrees(room.min())),
        "max_speed_fraction": float((np.abs(qd) / limits.speed).max()),
        "max_tool_speed_mm_s": 1e3 * max(speeds),
    }


def water_measures(end: MotionWithWater) -> dict[str, float]:
    """Return the measures of the water at the end of a run, by their names."""
    found = score(end.water, end.course)
    return {
        "emptied_percent": found.emptied_percent,
        "emptied_ml": found.in_basin_ml,
        "spilled_ml": found.spilled_ml,
        "cup_peak_jerk_m_s3": found.peak_jerk,
    }
