"""Measures of a run by name, of which a script may give bounds, and those of a measured arm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.state.arm_report import ArmReport
from katana450.arm.control.state.state import State
from katana450.caching import cached_property
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
        "spilled_ml": water.spilled / MILLILITRE,
        "cup_peak_jerk_m_s3": course.peak_jerk,
    }


MAX_LAG = 1.0
"""[s] Maximum lag in the search."""

COARSE, FINE = 0.01, 0.001
"""[s] Steps of the search for the lag."""

LONG_TICK = 0.025
"""[s] Time between two states above which the arm rested between them."""

SMALLEST_MOTION = 1e-3
"""[rad] Motion of the setpoints below which no lag can be found."""

PLACES = 500
"""Number of intervals of a path in which the place nearest to a measured point is searched."""

REFINEMENTS = 4
"""Number of Gauss-Newton steps from there. Each reduces the error along the path to a fraction: the
distance from the path by its radius. The error of the distance is of second order."""


@dataclass(frozen=True, eq=False)
class Deviation:
    """Distances of the tool from one desired path of a run, in the frame {S}.

    Attributes:
        path: the path.
        t: (N,) times of the measurements [s].
        measured: (N, 3) measured points of the tool [m].
        nearest: (N, 3) nearest points of the path [m].
        t_commanded: (M,) times of the setpoints [s].
        commanded: (M,) distances of the setpoints from the points of the path that were due [m].
    """

    path: CurvePath
    t: FloatArray
    measured: FloatArray
    nearest: FloatArray
    t_commanded: FloatArray
    commanded: FloatArray

    @property
    def error(self) -> FloatArray:
        """Distances (N,) of the measured points from the path [m]."""
        return np.asarray(np.linalg.norm(self.measured - self.nearest, axis=1))


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """A run with N measurements and M setpoints. Times are those of its states.

    Attributes:
        arm: the arm.
        states: (M,) the states.
        t: (N,) times of the measurements [s].
        q: (N, n) measured joints [rad].
        due: (N, n) joints at which the arm should have been by its driver, which knows how far
            ahead of their time setpoints are sent [rad].
        tools: (N,) the tool frames.
    """

    arm: ArmModel
    states: Sequence[State]
    t: FloatArray
    q: FloatArray
    due: FloatArray
    tools: tuple[str, ...]

    @staticmethod
    def of(arm: ArmModel, states: Sequence[State]) -> MeasuredRun | None:
        """Return the run of ``states``; None if nothing was measured while the arm followed."""
        rows: list[tuple[State, ArmReport]] = []
        for state in states:
            report = state.report
            if report is None or not report.mode.follows:
                continue
            if not rows or report.t > rows[-1][1].t:
                rows.append((state, report))
        if len(rows) < 2:
            return None
        return MeasuredRun(
            arm,
            states,
            np.array([report.t for _, report in rows]),
            np.array([state.q for state, _ in rows]),
            np.array([report.expected[:-1] for _, report in rows]),
            tuple(state.tool for state, _ in rows),
        )

    @cached_property
    def values(self) -> dict[str, float | None]:
        """Each measure of the measured arm by its name in ``measures.MEASURES``."""
        errors = [deviation.error for deviation in self.deviations]
        off = 1e3 * np.concatenate(errors) if errors else np.empty(0)
        lag = self.lag
        return {
            "measured_position_error_mm": float(off.max()) if off.size else None,
            "measured_rms_error_mm": math.sqrt(float(np.mean(off**2))) if off.size else None,
            "tool_tracking_error_mm": 1e3 * float(self.tool_errors.max()),
            "joint_tracking_error_deg": float(np.degrees(np.abs(self.q - self.due).max())),
            "tracking_lag_ms": None if lag is None else 1e3 * lag,
        }

    @cached_property
    def tool_errors(self) -> FloatArray:
        """Distances (N,) of the measured tool from where it should have been [m]."""
        tools = np.array(self.tools)
        errors = np.empty(len(tools))
        for tool in set(self.tools):
            rows, chain = tools == tool, self.arm.chain_to(tool)
            ends = [forward_batch(chain, q[rows])[:, :3, 3] for q in (self.q, self.due)]
            errors[rows] = np.linalg.norm(ends[0] - ends[1], axis=1)
        return errors

    @cached_property
    def lag(self) -> float | None:
        """The time [s] by which the measured joints are behind the setpoints, by least squares.

        A constant offset is not a lag. None without a motion.
        """
        t, q = self.setpoints
        if float(np.ptp(q, axis=0).max()) < SMALLEST_MOTION:
            return None

        def error(lag: float) -> float:
            columns = zip(self.q.T, q.T, strict=True)
            sent = self.t - lag
            return sum(
                float((own - np.interp(sent, t, setpoints)).var()) for own, setpoints in columns
            )

        coarse = min(np.arange(0.0, MAX_LAG + 0.5 * COARSE, COARSE).tolist(), key=error)
        near = np.arange(-COARSE, COARSE + 0.5 * FINE, FINE) + coarse
        best_lag: float = min(near[near > -0.5 * FINE].tolist(), key=error)
        return best_lag

    @cached_property
    def setpoints(self) -> tuple[FloatArray, FloatArray]:
        """Times (K,) [s] and setpoints (K, n) [rad] between which to interpolate."""
        t = np.array([state.t for state in self.states])
        q = np.array([state.setpoint for state in self.states])
        # An arm at rest has no states: its setpoint changes in the tick that ends such a gap.
        gaps = np.flatnonzero(np.diff(t) > LONG_TICK)
        return (
            np.insert(t, gaps + 1, t[gaps + 1] - COARSE),
            np.insert(q, gaps + 1, q[gaps], axis=0),
        )

    @cached_property
    def deviations(self) -> tuple[Deviation, ...]:
        """The deviations from each desired path of the tool, in the order of the run.

        A measurement belongs to the path on which the setpoint was ``lag`` before.
        """
        t = np.array([state.t for state in self.states])
        sent = np.searchsorted(t, self.t - (self.lag or 0.0), side="right") - 1
        deviations: list[Deviation] = []
        for path, ticks in paths_of(self.states):
            rows = np.flatnonzero(np.isin(sent, ticks))
            if not rows.size:
                continue
            measured = forward_batch(path.chain, self.q[rows])[:, :3, 3]
            commanded = commanded_errors(path, [self.states[number] for number in ticks])
            deviations.append(
                Deviation(
                    path,
                    self.t[rows],
                    measured,
                    nearest_points(path, measured),
                    t[ticks],
                    commanded,
                )
            )
        return tuple(deviations)


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


def nearest_points(path: CurvePath, points: FloatArray) -> FloatArray:
    """Return the point (N, 3) of ``path`` nearest to each of ``points`` (N, 3) [m]."""
    places = np.linspace(0.0, 1.0, PLACES + 1)
    coarse = point_derivatives(path, places)[0]
    apart = np.linalg.norm(points[:, None] - coarse, axis=2)
    sigma = places[apart.argmin(axis=1)]
    best: FloatArray = coarse[apart.argmin(axis=1)]
    for _ in range(REFINEMENTS):
        curve_points, tangent = point_derivatives(path, sigma)[:2]
        length = np.maximum((tangent**2).sum(axis=1), 1e-30)
        sigma = np.clip(sigma + ((points - curve_points) * tangent).sum(axis=1) / length, 0.0, 1.0)
        curve_points = point_derivatives(path, sigma)[0]
        nearer = np.linalg.norm(points - curve_points, axis=1) < np.linalg.norm(
            points - best, axis=1
        )
        best = np.where(nearer[:, None], curve_points, best)
    return best
