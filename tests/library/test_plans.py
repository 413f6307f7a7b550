"""Plans of the library: their goals, speeds and refusals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import katana450
from katana450.arm.control.commands import commands as cmd

CENTRE = np.array([0.15, 0.0, -0.11])


@pytest.fixture(scope="module")
def circle(shoulder_arm: katana450.Arm) -> katana450.MotionPlan:
    return shoulder_arm.circle(CENTRE, 0.1)


def test_plan_leads_from_start_to_goal_within_the_limits(shoulder_arm: katana450.Arm) -> None:
    goal = np.array([1.2, -1.0, 1.4, 0.3, 0.0])
    plan = shoulder_arm.plan(goal)
    samples = plan.sample(0.01)
    np.testing.assert_array_equal(samples.q[0], shoulder_arm.ready)
    np.testing.assert_array_equal(samples.q[-1], goal)
    assert samples.t[-1] == plan.duration
    for ends in (samples.qd[[0, -1]], samples.qdd[[0, -1]]):
        np.testing.assert_allclose(ends, 0.0, atol=1e-9)
    limits = shoulder_arm.robot.require_arm().limits
    assert (np.abs(samples.qd) <= limits.speed * (1.0 + 1e-9)).all()
    assert (np.abs(samples.qdd) <= limits.acceleration * (1.0 + 1e-9)).all()
    assert plan.clearance is not None
    assert plan.clearance > 6e-3


def test_samples_are_what_the_controller_does(
    shoulder_arm: katana450.Arm, circle: katana450.MotionPlan
) -> None:
    dt, session = 0.01, shoulder_arm.session
    samples = circle.sample(dt)
    state = session.begin(circle.start, 0.0, 0.0)
    commands: tuple[cmd.Command, ...] = (cmd.Follow(circle.core),)
    for number in range(1, len(samples)):
        state = session.step(state, commands, number * dt)
        state = session.observe(state, state.setpoint, state.gripper_setpoint)
        commands = ()
        # The controller plans the rest of the motion again in each tick, which delays it by up to
        # a millisecond.
        np.testing.assert_allclose(state.setpoint, samples.q[number], atol=1e-3)
        np.testing.assert_allclose(state.motion.qd, samples.qd[number], atol=1e-2)
    assert not state.moving


def test_circle_stays_on_the_circle_in_either_frame(
    shoulder_arm: katana450.Arm, base_arm: katana450.Arm, circle: katana450.MotionPlan
) -> None:
    centre = (shoulder_arm.T_base_frame @ [*CENTRE, 1.0])[:3]
    in_base = base_arm.circle(centre, 0.1)
    for plan, middle in ((circle, CENTRE), (in_base, centre)):
        arms = plan.sample(0.02).points - middle
        np.testing.assert_allclose(arms[:, 0], 0.0, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(arms, axis=1), 0.1, atol=1e-12)
        assert arms[0, 2] == pytest.approx(0.1)
    np.testing.assert_allclose(in_base.start, circle.start, atol=1e-9)


def test_circle_from_a_start_goes_to_it_first(
    shoulder_arm: katana450.Arm, circle: katana450.MotionPlan
) -> None:
    plan = shoulder_arm.circle(CENTRE, 0.1, start=shoulder_arm.ready)
    np.testing.assert_array_equal(plan.start, shoulder_arm.ready)
    np.testing.assert_allclose(plan.end, circle.end, atol=1e-9)
    assert plan.duration > circle.duration
    samples = plan.sample(0.05)
    assert (np.diff(samples.t) > 0.0).all()
    assert np.abs(np.diff(samples.q, axis=0)).max() < 0.05 * shoulder_arm.speed.max()


def test_line_is_straight_and_keeps_the_tool_as_it_is(base_arm: katana450.Arm) -> None:
    by = np.array([0.04, 0.03, -0.05])
    samples = base_arm.line(by=by).sample(0.01)
    offsets = samples.points - samples.points[0]
    np.testing.assert_allclose(np.cross(offsets, by), 0.0, atol=1e-12)
    np.testing.assert_allclose(offsets[-1], by, atol=1e-12)
    np.testing.assert_allclose(samples.q[:, 1:4].sum(axis=1), base_arm.ready[1:4].sum())
    same = base_arm.line(samples.points[-1])
    np.testing.assert_allclose(same.end, samples.q[-1], atol=1e-9)


def test_plan_keeps_clear_of_a_scene(tmp_path: Any) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(
        "scene: 1\nobjects:\n- {name: wall, shape: box, size: [20, 400, 600], "
        "pose: [560, 0, 300, 0, 0, 0]}\n"
    )
    arm = katana450.load(scene=file)
    with pytest.raises(katana450.BlockedError, match="wall"):
        arm.line(by=(0.09, 0.0, 0.0))


def test_blocked_goal_names_the_bodies(shoulder_arm: katana450.Arm) -> None:
    with pytest.raises(katana450.BlockedError, match="finger_right_link and table"):
        shoulder_arm.plan([1.47, -0.79, 1.87, 0.66, 0.06])


def test_plan_is_plotted_in_space_and_over_time(circle: katana450.MotionPlan) -> None:
    plt = pytest.importorskip("matplotlib.pyplot")
    plt.switch_backend("Agg")
    figure = circle.plot()
    space, panel = figure.axes
    x, y, z = space.lines[0].get_data_3d()
    np.testing.assert_allclose(x, 150.0, atol=1e-9)
    np.testing.assert_allclose(np.hypot(y, np.array(z) + 110.0), 100.0, atol=1e-9)
    assert len(panel.lines) == 5
    plt.close(figure)


REFUSED: dict[str, tuple[Callable[[katana450.Arm], Any], str]] = {
    "goal beyond a limit": (lambda arm: arm.plan([0.0, 1.0, 0.0, 0.0, 0.0]), "axis 2"),
    "short goal": (lambda arm: arm.plan([0.0, 1.0]), "shape"),
    "start with NaN": (lambda arm: arm.plan([0.0] * 5, [np.nan] * 5), "axis 1"),
    "at the goal": (lambda arm: arm.plan(arm.ready), "already"),
    "pose out of reach": (lambda arm: arm.plan(2.0 * arm.fk(arm.ready) - np.eye(4)), "rotation"),
    "line out of reach": (lambda arm: arm.line(by=(1.0, 0.0, 0.0)), "reach"),
    "line to two ends": (lambda arm: arm.line((0.3, 0.0, 0.0), by=(0.1, 0.0, 0.0)), "either"),
    "line to nowhere": (lambda arm: arm.line((0.3, np.nan, 0.0)), "end of the line"),
    "line without motion": (lambda arm: arm.line(), "moves nothing"),
    "no radius": (lambda arm: arm.circle(CENTRE, 0.0), "above 0"),
    "radius of several": (lambda arm: arm.circle(CENTRE, [0.1, 0.1]), "shape"),  # type: ignore[arg-type]
    "flat centre": (lambda arm: arm.circle((0.1, 0.2), 0.1), "centre"),
    "no normal": (lambda arm: arm.circle(CENTRE, 0.1, normal=(0.0, 0.0, 0.0)), "direction"),
    "no turns": (lambda arm: arm.circle(CENTRE, 0.1, turns=0.0), "turns"),
    "words for a pitch": (lambda arm: arm.circle(CENTRE, 0.1, pitch="down"), "'down'"),  # type: ignore[arg-type]
    "huge circle": (lambda arm: arm.circle(CENTRE, 2.0), "pitch"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_impossible_plans_are_refused_with_the_reason(
    shoulder_arm: katana450.Arm, case: str
) -> None:
    call, message = REFUSED[case]
    with pytest.raises(katana450.InputError, match=message):
        call(shoulder_arm)


@pytest.mark.parametrize("dt", [0.0, -0.01, np.nan, np.inf, 1e-9, "fast"])
def test_unusable_sampling_times_are_refused(circle: katana450.MotionPlan, dt: Any) -> None:
    with pytest.raises(katana450.InputError, match="sampling time"):
        circle.sample(dt)
