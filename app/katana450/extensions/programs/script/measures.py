"""Measures of a run by name, of which a script may give bounds; those that need no plan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.velocity import singular_values
from katana450.maths.water.flow import Water
from katana450.maths.water.motion import Course
from katana450.maths.water.units import MILLILITRE

MEASURES: Final = {
    "max_position_error_mm": "distance of the planned tool positions from the desired path",
    "rms_position_error_mm": "the same, root mean square",
    "max_orientation_error_deg": "deviation of the tool from the desired pitch and roll",
    "executed_position_error_mm": "distance of the setpoints at each tick from the desired path",
    "between_ticks_error_mm": "the same half-way between ticks, joints interpolated linearly",
    "measured_position_error_mm": "distance of the measured tool from the desired path",
    "measured_rms_error_mm": "the same, root mean square",
    "tool_tracking_error_mm": "distance of the measured tool from where it was sent by then",
    "joint_tracking_error_deg": "the same of the joints, maximum of all",
    "tracking_lag_ms": "time by which the measured joints are behind the setpoints",
    "path_length_mm": "length of the tool's paths",
    "smallest_singular_value": "of the Jacobian, translations divided by the characteristic length",
    "margin_to_limits_deg": "minimum of all joints over the whole run",
    "nearest_clearance_mm": "minimum of all pairs of parts; plans that lift an object are left out",
    "max_speed_fraction": "maximum of all joints, as a fraction of the limit",
    "max_acceleration_fraction": "the same of the acceleration, over two ticks",
    "max_jerk_fraction": "the same of the jerk, over three ticks",
    "max_tool_speed_mm_s": "of the tool point",
    "duration_s": "of the run",
    "emptied_percent": "fraction of the water that is in the basin at the end",
    "spilled_ml": "water on table and floor at the end",
    "carried_margin_to_rim_mm": "minimum height of the lip above the water, until it is poured",
    "cup_peak_jerk_m_s3": "maximum of the cup's middle, over one tick",
}
"""Name of each measure, with its unit at the end, and its definition."""

OF_A_MEASURED_ARM: Final = frozenset(
    (
        "measured_position_error_mm",
        "measured_rms_error_mm",
        "tool_tracking_error_mm",
        "joint_tracking_error_deg",
        "tracking_lag_ms",
    )
)
"""Measures of an arm that is measured beside its setpoints."""

UNITS: Final = {
    "_m_s3": "m/s³",
    "_mm_s": "mm/s",
    "_mm": "mm",
    "_ml": "ml",
    "_percent": "%",
    "_deg": "deg",
    "_ms": "ms",
    "_s": "s",
}
"""Unit of a measure by the suffix of its name; longer suffixes first."""


def unit_of(measure: str) -> str:
    """Return the unit of ``measure``; "" for a number."""
    return next((unit for end, unit in UNITS.items() if measure.endswith(end)), "")


def title_of(measure: str) -> str:
    """Return the name of ``measure`` for people, without its unit."""
    end = next((end for end in UNITS if measure.endswith(end)), "")
    return measure.removesuffix(end).replace("_", " ").capitalize()


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
    speeds = [arm.kinematics_to(tool).tool_speed(*posture) for tool, *posture in rows]
    return {
        "smallest_singular_value": float(min(singular)),
        "margin_to_limits_deg": float(np.degrees(room.min())),
        "max_speed_fraction": float((np.abs(qd) / limits.speed).max()),
        "max_tool_speed_mm_s": 1e3 * max(speeds),
    }


def water_measures(water: Water, course: Course) -> dict[str, float]:
    """Return the measures of ``water`` after the ``course`` of the cup, by their names.

    ``emptied_percent`` is NaN without water.
    """
    total = water.total
    return {
        "emptied_percent": 100.0 * water.basin / total if total else math.nan,
        "emptied_ml": water.basin / MILLILITRE,
        "spilled_ml": water.spilled / MILLILITRE,
        "cup_peak_jerk_m_s3": course.peak_jerk,
    }
