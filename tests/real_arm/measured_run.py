"""Measures of a run whose arm was measured: its lag, its errors, its distance from the path."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.state.arm_report import ArmReport
from katana450.arm.control.state.state import State
from katana450.caching import cached_property
from katana450.extensions.programs.script.measures import commanded_errors, paths_of
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.planning.path import CurvePath, point_derivatives

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
