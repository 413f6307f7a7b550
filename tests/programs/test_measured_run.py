"""Measures of a measured arm: found again for an arm whose errors are known."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.extensions.programs.run.simulation import (
    Planned,
    Simulation,
    plan_script,
    run_by_clock,
)
from katana450.extensions.programs.script.measures import (
    MEASURES,
    MeasuredRun,
    nearest_points,
    path_of,
)
from katana450.extensions.programs.script.script import parse
from katana450.extensions.real_arm.plant.axis import KATANA450
from katana450.extensions.real_arm.plant.driver import PlantDriver
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.path import point_derivatives
from katana450.resources import URDF_PATH
from tests.programs.lagging_driver import LaggingDriver

TEXT = """
frame: base
tool: tcp
steps:
  - line: {by: {z: 60}}
  - circle: {centre: [300, 0, 250], normal: y, radius: 40, turns: 1, pitch: roomiest}
"""
LINE = "frame: base\ntool: tcp\nsteps:\n  - line: {by: {y: 80}}\n"
TICKS = 12
OFFSET = np.array((0.004, 0.0, -0.01, 0.0, 0.0))


def planned(text: str) -> Planned:
    return plan_script(parse(text), URDF_PATH)


def lagging(plan: Planned, offset: FloatArray = OFFSET) -> Simulation:
    arm, start = plan.robot.require_arm(), plan.start
    return run_by_clock(plan, LaggingDriver(arm, start.q, start.gripper, TICKS, offset))


@pytest.fixture(scope="module")
def line() -> tuple[Planned, Simulation, MeasuredRun]:
    plan = planned(LINE)
    simulation = lagging(plan)
    run = MeasuredRun.of(plan.robot.require_arm(), simulation.states)
    assert run is not None
    return plan, simulation, run


def test_known_lag_and_errors_are_found(line: tuple[Planned, Simulation, MeasuredRun]) -> None:
    plan, simulation, run = line
    assert set(run.values) < set(MEASURES)
    # Constant angles beside the setpoints are no lag.
    assert run.values["tracking_lag_ms"] == pytest.approx(10.0 * TICKS, abs=3.0)
    assert run.values["joint_tracking_error_deg"] == pytest.approx(np.degrees(0.01))
    chain = plan.robot.require_arm().chain
    states = simulation.states
    apart = [
        np.linalg.norm(
            forward(chain, s.setpoint + OFFSET)[:3, 3] - forward(chain, s.setpoint)[:3, 3]
        )
        for s in states
    ]
    assert run.values["tool_tracking_error_mm"] == pytest.approx(1e3 * max(apart), rel=1e-3)
    still = MeasuredRun.of(plan.robot.require_arm(), states[-5:])
    assert still is not None
    assert still.values["tracking_lag_ms"] is None


def test_distances_are_those_from_the_line(
    line: tuple[Planned, Simulation, MeasuredRun],
) -> None:
    plan, simulation, run = line
    chain = plan.robot.require_arm().chain
    (deviation,) = run.deviations
    first, last = point_derivatives(deviation.path, np.array((0.0, 1.0)))[0]
    direction = (last - first) / np.linalg.norm(last - first)
    assert np.linalg.norm(last - first) == pytest.approx(0.08)
    on = [state for state in simulation.states if path_of(state) is deviation.path]
    expected = []
    for state in on[: -TICKS - 1]:
        off = forward(chain, state.setpoint + OFFSET)[:3, 3] - first
        along = min(max(float(off @ direction), 0.0), 0.08)
        expected.append(float(np.linalg.norm(off - along * direction)))
    assert run.values["measured_position_error_mm"] == pytest.approx(1e3 * max(expected), rel=0.01)
    rms = 1e3 * float(np.sqrt(np.mean(np.square(expected))))
    assert run.values["measured_rms_error_mm"] == pytest.approx(rms, rel=0.02)
    assert max(expected) > 1e-3
    assert deviation.commanded.max() < 1e-12


def test_arm_that_is_only_late_stays_on_its_path() -> None:
    plan = planned(TEXT)
    simulation = lagging(plan, np.zeros(5))
    run = MeasuredRun.of(plan.robot.require_arm(), simulation.states)
    assert run is not None
    assert len(run.deviations) == 2
    assert run.values["joint_tracking_error_deg"] == 0.0
    # On the circle, and also round the corner between both paths.
    assert (run.values["measured_position_error_mm"] or 1.0) < 1e-6


def test_nearest_points_of_a_circle_are_on_its_radius() -> None:
    plan = planned(TEXT)
    states = run_by_clock(plan).states
    path = next(path for state in reversed(states) if (path := path_of(state)) is not None)
    points = point_derivatives(path, np.linspace(0.0, 1.0, 7))[0]
    centre = points[:-1].mean(axis=0)
    radial = (points - centre) / np.linalg.norm(points - centre, axis=1)[:, None]
    aside = np.array((0.0, 0.003, 0.0))
    nearest = nearest_points(path, points + 0.005 * radial + aside)
    np.testing.assert_allclose(nearest, points, atol=1e-7)
    off = np.linalg.norm(points + 0.005 * radial + aside - nearest, axis=1)
    np.testing.assert_allclose(off, np.hypot(0.005, 0.003), rtol=1e-9)


def test_exact_arm_is_not_measured_and_has_no_such_trace() -> None:
    plan = planned(LINE)
    simulation = run_by_clock(plan)
    assert MeasuredRun.of(plan.robot.require_arm(), simulation.states) is None
    assert simulation.measured is None


def test_plant_lags_by_its_delay_and_friction() -> None:
    """20 ms of delay, and 2 b / w^2 = 2 ms behind by viscous friction and its damper."""
    plan = planned(LINE)
    plant = PlantDriver(plan.robot, plan.start.q, plan.start.gripper, KATANA450)
    simulation = run_by_clock(plan, plant)
    run = MeasuredRun.of(plan.robot.require_arm(), simulation.states)
    assert run is not None
    assert 18.0 <= (run.values["tracking_lag_ms"] or 0.0) <= 40.0
    assert 0.01 < (run.values["measured_position_error_mm"] or 0.0) < 2.0
    assert 0.0 < (run.values["joint_tracking_error_deg"] or 0.0) < 0.5
    assert simulation.measured is not None
    # The setpoints are apart from what is measured.
    assert np.abs(simulation.measured - simulation.q).max() > 1e-3
