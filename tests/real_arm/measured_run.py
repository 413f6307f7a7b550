"""The lag of a measured arm behind its setpoints, and its distance from the desired path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.state.state import State
from katana450.extensions.programs.script.measures import commanded_errors, paths_of
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.planning.path import CurvePath, point_derivatives

LAGS = np.arange(0.0, 1.0, 0.002)
"""[s] Lags among which the one of an arm is searched."""

PLACES = 5000
"""Number of intervals of a path in which the place nearest to a measured point is searched."""


class MeasuredRun(NamedTuple):
    """Measures of a run.

    Attributes:
        lag: time by which the measured joints are behind the setpoints, by least squares [s].
        error: largest distance of the measured tool from the desired path [m].
        commanded: largest distance of the setpoints from where they were due on it [m].
    """

    lag: float
    error: float
    commanded: float


def measured_run(arm: ArmModel, states: Sequence[State]) -> MeasuredRun:
    """Return the measures of ``states``, in which the arm was measured and followed a path."""
    reports = [state.report for state in states if state.report is not None]
    newest = np.unique([report.t for report in reports], return_index=True)[1]
    rows = [state for state in states if state.report is not None]
    q = np.array([rows[number].q for number in newest])
    times = np.array([reports[number].t for number in newest])
    t = np.array([state.t for state in states])
    setpoints = np.array([state.setpoint for state in states])

    def misfit(lag: float) -> float:
        columns = zip(q.T, setpoints.T, strict=True)
        return sum(float((own - np.interp(times - lag, t, sent)).var()) for own, sent in columns)

    lag = min(LAGS.tolist(), key=misfit)
    sent = np.searchsorted(t, times - lag, side="right") - 1
    errors, commanded = [0.0], [0.0]
    for path, ticks in paths_of(states):
        on_path = np.isin(sent, ticks)
        if on_path.any():
            points = forward_batch(arm.chain_to(states[ticks[0]].tool), q[on_path])[:, :3, 3]
            errors.append(distance(path, points))
        commanded.append(float(commanded_errors(path, [states[n] for n in ticks]).max()))
    return MeasuredRun(lag, max(errors), max(commanded))


def distance(path: CurvePath, points: FloatArray) -> float:
    """Return the largest distance of ``points`` (N, 3) from ``path`` [m]."""
    places = point_derivatives(path, np.linspace(0.0, 1.0, PLACES + 1))[0]
    return max(float(np.linalg.norm(places - point, axis=1).min()) for point in points)
