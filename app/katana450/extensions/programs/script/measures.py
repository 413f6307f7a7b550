"""Measures of a run by name, of which a script may give bounds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.state.state import State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.velocity import singular_values
from katana450.maths.planning.path import CurvePath, point_derivatives
from katana450.maths.water.flow import Course, Water
from katana450.maths.water.units import MILLILITRE

MEASURES: Final = {
    "max_position_error_mm": "distance of the planned tool positions from the desired path",
    "rms_position_error_mm": "the same, root mean square",
    "max_orientation_error_deg": "deviation of the tool from the desired pitch and roll",
    "executed_position_error_mm": "distance of the setpoints at each tick from the desired path",
    "between_ticks_error_mm": "the same half-way between ticks, joints interpolated linearly",
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

UNITS: Final = {
    "_m_s3": "m/s³",
    "_mm_s": "mm/s",
    "_mm": "mm",
    "_ml": "ml",
    "_percent": "%",
    "_deg": "deg",
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
        "spilled_ml": water.spilled / MILLILITRE,
        "cup_peak_jerk_m_s3": course.peak_jerk,
    }


def path_of(state: State) -> CurvePath | None:
    """Return the desired path of the tool on which the setpoint of ``state`` is; None without."""
    path = None if state.following is None else state.following.segment.path
    return path if isinstance(path, CurvePath) else None


def paths_of(states: Sequence[State]) -> list[tuple[CurvePath, list[int]]]:
    """Return each desired path of the tool, with the numbers of the ``states`` that are on it."""
    numbers: dict[int, tuple[CurvePath, list[int]]] = {}
    for number, state in enumerate(states):
        if (path := path_of(state)) is not None:
            numbers.setdefault(id(path), (path, []))[1].append(number)
    return list(numbers.values())


def path_fraction(state: State) -> float:
    """Return the place on the path of the plan, from 0 to 1; 0 while the arm follows no plan."""
    following = state.following
    return 0.0 if following is None else following.segment.scaling.pace(following.local).sigma


def commanded_errors(path: CurvePath, states: Sequence[State]) -> FloatArray:
    """Return the distances (N,) [m] of the setpoints from the points of ``path`` that were due."""
    points = forward_batch(path.chain, np.array([state.setpoint for state in states]))[:, :3, 3]
    desired = point_derivatives(path, np.array([path_fraction(state) for state in states]))[0]
    return np.asarray(np.linalg.norm(points - desired, axis=1))


def run_errors(states: Sequence[State]) -> FloatArray:
    """Return the distances (N,) [m] of the setpoints from all desired paths of the tool."""
    errors = [
        commanded_errors(path, [states[number] for number in numbers])
        for path, numbers in paths_of(states)
    ]
    return np.concatenate(errors) if errors else np.empty(0)
