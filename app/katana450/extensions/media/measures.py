"""Measures of a run, its water over time, and comparison with the bounds that its script expects.

Two errors are distinguished. The kinematic error is the distance of the planned joints' forward
kinematics from the desired path. The motion error is the distance of the moving arm from the path,
at each tick and between two ticks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from katana450.extensions.programs.building.actions import FollowPlan, Task
from katana450.extensions.programs.run.simulation import Simulation
from katana450.extensions.programs.script.measures import (
    motion_measures,
    path_fraction,
    path_of,
    run_errors,
    water_measures,
)
from katana450.extensions.programs.script.script import Script
from katana450.extensions.programs.steps.pouring import POURING
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import CurvePath, joint_derivatives, point_derivatives
from katana450.maths.water.flow import MotionWithWater
from katana450.maths.water.units import MILLILITRE

PATH_SAMPLES = 2000
"""Number of intervals of each path at whose ends the kinematics are compared."""

SMALLEST = float(np.finfo(float).tiny)
"""Smallest divisor."""


@dataclass(frozen=True, eq=False)
class PathTrace:
    """One path of the tool.

    Attributes:
        name: name of the task.
        sigma: (N,) places on the path.
        desired: (N, 3) desired points in {S} [m].
        traced: (N, 3) points of the planned joints in {S} [m].
        turned: (N,) error of pitch or roll, the larger one, or of the rotation for an arm outside
            the five-axis family [rad].
    """

    name: str
    sigma: FloatArray
    desired: FloatArray
    traced: FloatArray
    turned: FloatArray

    @property
    def error(self) -> FloatArray:
        """The position error (N,) [m]."""
        return np.asarray(np.linalg.norm(self.traced - self.desired, axis=1))


@dataclass(frozen=True)
class Bound:
    """The bound that a script expects of a measure, and its value."""

    name: str
    low: float
    high: float
    value: float | None

    @property
    def held(self) -> bool:
        """True if the value is within the bound."""
        return self.value is not None and self.low <= self.value <= self.high

    @property
    def wanted(self) -> str:
        """The bound in words."""
        wanted = [f"at least {self.low:g}"] if self.low > -np.inf else []
        wanted += [f"at most {self.high:g}"] if self.high < np.inf else []
        return " and ".join(wanted) or "any"

    def __str__(self) -> str:
        is_now = "was not measured" if self.value is None else f"is {self.value:.3g}"
        return f"{self.name} {is_now}; expected is {self.wanted}."


def executed_tasks(run: Simulation) -> tuple[Task, ...]:
    """Return the tasks of a run, without those of alternatives that it has not taken."""
    executed = set(run.tasks.tolist())
    return tuple(task for number, task in enumerate(run.program.tasks) if number in executed)


def traced_paths(run: Simulation) -> tuple[PathTrace, ...]:
    """Return the paths of the tool in a run, each repeated path once."""
    traces: dict[int, PathTrace] = {}
    for task in executed_tasks(run):
        if not isinstance(task.action, FollowPlan):
            continue
        for segment in task.action.plan.segments:
            path = segment.path
            if isinstance(path, CurvePath) and id(path) not in traces:
                traces[id(path)] = _traced(task.name, path)
    return tuple(traces.values())


def measurements(run: Simulation) -> dict[str, float | None]:
    """Return each of MEASURES by its name; None if it does not apply."""
    paths, limits = traced_paths(run), run.arm.limits
    errors = np.concatenate([path.error for path in paths]) if paths else np.empty(0)
    turned = np.concatenate([path.turned for path in paths]) if paths else np.empty(0)
    tools = [state.tool for state in run.states]
    moved = motion_measures(run.arm, tools, run.q, run.qd)
    nearest = [
        task.action.plan.nearest.contact.distance
        for task in executed_tasks(run)
        if isinstance(task.action, FollowPlan)
        and task.action.plan.nearest is not None
        # An object to be lifted touches the table at first.
        and task.action.plan.nearest.contact.distance >= MIN_CLEARANCE
    ]
    return {
        "max_position_error_mm": _maximum(1e3 * errors),
        "rms_position_error_mm": 1e3 * float(np.sqrt(np.mean(errors**2))) if paths else None,
        "max_orientation_error_deg": _maximum(np.degrees(turned)),
        "executed_position_error_mm": _maximum(1e3 * run_errors(run.states)),
        "between_ticks_error_mm": _maximum(1e3 * errors_between_ticks(run)),
        "path_length_mm": 1e3 * sum(_length(path.desired) for path in paths) if paths else None,
        "smallest_singular_value": moved["smallest_singular_value"],
        "margin_to_limits_deg": moved["margin_to_limits_deg"],
        "nearest_clearance_mm": 1e3 * min(nearest) if nearest else None,
        "max_speed_fraction": moved["max_speed_fraction"],
        "max_acceleration_fraction": _fraction(run, limits.acceleration, 2),
        "max_jerk_fraction": _fraction(run, limits.jerk, 3),
        "max_tool_speed_mm_s": moved["max_tool_speed_mm_s"],
        "duration_s": float(run.t[-1]),
        **_of_water(run),
    }


def errors_between_ticks(run: Simulation) -> FloatArray:
    """Return the distances (N,) [m] of the setpoints across the tool's paths, midway between ticks.

    The joints are interpolated linearly, as by a drive.
    """
    errors: list[float] = []
    for before, after in pairwise(run.states):
        path, sigma, next_sigma = path_of(before), path_fraction(before), path_fraction(after)
        if path is None or path is not path_of(after) or sigma == next_sigma:
            continue
        point = path.point(Jet.variable(0.5 * (sigma + next_sigma)))
        p, rate = np.array([coordinate.derivatives()[:2] for coordinate in point], dtype=float).T
        off = _point(path, 0.5 * (before.setpoint + after.setpoint)) - p
        # No motion gives a zero rate.
        along = (off @ rate) / max(float(rate @ rate), SMALLEST) * rate
        errors.append(float(np.linalg.norm(off - along)))
    return np.array(errors)


def bounds(script: Script, values: dict[str, float | None]) -> tuple[Bound, ...]:
    """Return the bounds that ``script`` expects, with the measured values."""
    return tuple(
        Bound(name, low, high, values.get(name)) for name, (low, high) in script.expected.items()
    )


def _traced(name: str, path: CurvePath) -> PathTrace:
    sigma = np.linspace(0.0, 1.0, PATH_SAMPLES + 1)
    q = joint_derivatives(path, sigma)[0]
    traced = np.array([_point(path, posture) for posture in q])
    return PathTrace(
        name, sigma, point_derivatives(path, sigma)[0], traced, path.turned_off(sigma, q)
    )


def _point(path: CurvePath, q: FloatArray) -> FloatArray:
    p: FloatArray = forward(path.chain, q)[:3, 3]
    return p


def _fraction(run: Simulation, maximum: FloatArray, order: int) -> float:
    """Return the maximum derivative of that order of the setpoints as a fraction of ``maximum``."""
    period = float(run.t[-1]) / (len(run.t) - 1)
    return float((np.abs(np.diff(run.q, order, axis=0)) / period**order / maximum).max(initial=0.0))


def _length(points: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _of_water(run: Simulation) -> dict[str, float | None]:
    """Return the measures of the water; none without water."""
    end = run.states[-1].poured
    if end is None:
        return {}
    measured = water_measures(end.water, end.course)
    tasks = run.program.tasks
    executed = sorted(set(run.tasks.tolist()))
    pours = [number for number in executed if tasks[number].name == POURING]
    carried = run.tasks < (pours[0] if pours else len(tasks))
    return {
        "emptied_percent": measured["emptied_percent"],
        "spilled_ml": measured["spilled_ml"],
        "carried_margin_to_rim_mm": 1e3 * float(run.margin[carried].min()),
        "cup_peak_jerk_m_s3": measured["cup_peak_jerk_m_s3"],
    }


def _maximum(values: FloatArray) -> float | None:
    return float(values.max()) if values.size else None


FLOW_TICKS = 10
"""Number of ticks over which the flow is averaged."""


@dataclass(frozen=True, eq=False)
class PourRecord:
    """The water at N ticks; NaN before there is water.

    Attributes:
        t: (N,) [s].
        cup, basin, air, spilled: (N,) volumes [ml].
        tilt: (N,) tilt of the cup [rad].
        lip: (N,) height of the lip above the water [m]; NaN for an empty cup.
    """

    t: FloatArray
    cup: FloatArray
    basin: FloatArray
    air: FloatArray
    spilled: FloatArray
    tilt: FloatArray
    lip: FloatArray

    @staticmethod
    def of(run: Simulation) -> PourRecord | None:
        """Return the record of ``run``; None for one without water."""
        rows = np.array([_row(state.poured) for state in run.states])
        if not (np.nan_to_num(rows[:, :4]) > 0.0).any():
            return None
        cup, basin, air, spilled, tilt = rows.T
        lip = np.where(np.isfinite(run.margin) & (cup > 0.0), run.margin, math.nan)
        return PourRecord(run.t, cup, basin, air, spilled, tilt, lip)

    @property
    def flow(self) -> FloatArray:
        """The flow out of the cup (N,) [ml/s], the mean of FLOW_TICKS ticks."""
        before = np.roll(self.cup, FLOW_TICKS)
        before[:FLOW_TICKS] = math.nan
        passed = self.t - np.roll(self.t, FLOW_TICKS)
        rate = (before - self.cup) / np.where(passed > 0.0, passed, math.nan)
        # The filling of the cup is no flow.
        return np.maximum(np.nan_to_num(rate), 0.0)

    @property
    def columns(self) -> dict[str, FloatArray]:
        """The columns (N,) of the water in the table of a run, by their names."""
        return {
            "cup_ml": self.cup,
            "basin_ml": self.basin,
            "air_ml": self.air,
            "spilled_ml": self.spilled,
            "cup_tilt_deg": np.degrees(self.tilt),
            "lip_above_water_mm": 1e3 * self.lip,
        }


def _row(poured: MotionWithWater | None) -> tuple[float, ...]:
    """Return the four volumes [ml] and the tilt [rad] of `PourRecord`."""
    if poured is None:
        return (math.nan,) * 5
    water = poured.water
    volumes = (water.cup.volume, water.basin, water.air, water.spilled)
    return (
        *(volume / MILLILITRE for volume in volumes),
        math.acos(min(max(float(water.cup.T[2, 2]), -1.0), 1.0)),
    )
