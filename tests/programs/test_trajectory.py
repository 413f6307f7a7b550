"""A trajectory passes its postures at its times, within the limits, and is checked for contacts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.arm.control.commands.commands import PlaceObject
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.steps.trajectory import CubicSpline, TrajectoryPath
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.forward import forward
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import joint_derivatives
from tests.programs.conftest import TICK, Stage
from tests.programs.test_continuation import (
    after_return,
    off_path,
    played,
    rest_of,
    stopped_after,
)

READY = (0.0, -68.0, 85.0, 8.0, 0.0)


def script(rows: list[list[float]], *more: str) -> str:
    lines = "".join(f"      - {row}\n" for row in rows)
    return "steps:\n" + "".join(more) + "  - trajectory:\n      through:\n" + lines


def swing(seconds: float, amplitude: float = 10.0) -> list[list[float]]:
    """Return rows [s, deg] in which axis 1 swings once to ``amplitude`` [deg] and back."""
    times = np.linspace(0.0, seconds, 13)
    turned = 0.5 * amplitude * (1.0 - np.cos(2.0 * np.pi * times / seconds))
    return [[float(t), float(a), *READY[1:]] for t, a in zip(times, turned, strict=True)]


def plan_of(program: Program) -> tuple[TrajectoryPath, float]:
    """Return the trajectory, and the time [s] at full speed without the ramps."""
    plans = [task.action.plan for task in program.tasks if isinstance(task.action, FollowPlan)]
    segment = plans[-1].segments[0]
    assert isinstance(segment.path, TrajectoryPath)
    return segment.path, segment.scaling.span


@settings(max_examples=20)
@given(st.lists(st.floats(0.01, 2.0), min_size=2, max_size=12), st.integers(0, 1000))
def test_spline_passes_its_values_smoothly(steps: list[float], seed: int) -> None:
    times = np.append(0.0, np.cumsum(steps))
    values = np.random.default_rng(seed).normal(size=(len(times), 3))
    spline = CubicSpline(times, values)
    np.testing.assert_allclose(spline.values_at(times), values, atol=1e-9)
    for t in times[1:-1]:
        before, after = (
            [jet.derivatives() for jet in spline.at(Jet.variable(float((t + side) / times[-1])))]
            for side in (-1e-9, 1e-9)
        )
        for one, other in zip(before, after, strict=True):
            scale = 1.0 + max(abs(one[3]), abs(other[3]))
            np.testing.assert_allclose(one[:3], other[:3], atol=1e-7 * scale)


def test_times_that_cannot_be_kept_are_named_with_the_reason(stage: Stage) -> None:
    fast = stage.planned(script([[0.0, *READY], [0.01, 60.0, *READY[1:]]]))
    (note,) = fast.notes
    assert note == (
        "Line 2, trajectory: Asked to take 0.01 s, it takes 1.56 s, because the speeds and "
        "accelerations of the joints are limited."
    )
    assert stage.planned(script(swing(60.0))).notes == ()


def test_gentle_trajectory_keeps_its_times(stage: Stage) -> None:
    rows = swing(4.0)
    program = stage.planned(script(rows))
    path, span = plan_of(program)
    assert span == pytest.approx(path.duration, rel=1e-9) == 4.0
    run, states = stage.play(program, stage.begin())
    assert run.phase is Phase.DONE
    q = np.degrees([state.setpoint[0] for state in states])
    assert q.max() == pytest.approx(10.0, abs=1e-2)
    assert (stage.loads(states)[:2] <= 1.0).all()
    # The ramps at the ends delay it; in between it has the recorded rate.
    top = int(np.argmax(q)) * TICK
    assert 2.0 < top < 2.5
    assert len(states) * TICK < 5.0


def test_fast_trajectory_is_slowed_to_the_limits(stage: Stage) -> None:
    program = stage.planned(script(swing(0.8, 40.0)))
    path, span = plan_of(program)
    assert path.duration == 0.8
    assert span > 1.2
    run, states = stage.play(program, stage.begin())
    assert run.phase is Phase.DONE
    assert (stage.loads(states) <= 1.001).all()
    assert np.degrees(max(state.setpoint[0] for state in states)) == pytest.approx(40.0, abs=0.05)


def test_speed_of_a_part_is_kept_where_another_part_is_too_fast(stage: Stage) -> None:
    rows = swing(4.0)
    fast = [[4.0 + t, *angles] for t, *angles in swing(0.8, 40.0)[1:]]
    program = stage.planned(script(rows + fast))
    action = program.tasks[-1].action
    assert isinstance(action, FollowPlan)
    scaling = action.plan.segments[0].scaling
    assert scaling.tau(3.0 / 4.8) == pytest.approx(3.0)
    # Slowed as a whole, it would take 16 s.
    assert 5.0 < scaling.span < 8.0


def test_arm_first_goes_to_the_start(stage: Stage) -> None:
    rows = [[t + 7.5, a + 30.0, *rest] for t, a, *rest in swing(3.0)]
    program = stage.planned(script(rows))
    assert [task.name for task in program.tasks][-2:] == ["trajectory: approach", "trajectory"]
    run, states = stage.play(program, stage.begin())
    assert run.phase is Phase.DONE
    np.testing.assert_allclose(np.degrees(states[-1].setpoint), (30.0, *READY[1:]), atol=1e-9)


def with_box(stage: Stage, q: FloatArray) -> State:
    """Return the state with a box where the tool is at ``q`` (5,) [rad]."""
    state = stage.begin()
    T = stage.plan_context.T_base_shoulder @ forward(stage.plan_context.arm.chain, q)
    place = np.eye(4)
    place[:3, 3] = T[:3, 3] - (0.0, 0.0, 0.02)
    box = SceneObject("box", Shape.BOX, (0.04, 0.04, 0.04), place)
    return stage.session.step(state, (PlaceObject(box),), TICK)


def test_stopped_trajectory_continues_on_its_path(stage: Stage) -> None:
    program = stage.planned(script(swing(4.0, 30.0)))
    path, _ = plan_of(program)
    run, state = stopped_after(stage, program, 150)
    rest = rest_of(stage, program, run, state)
    states = played(stage, rest, state)
    np.testing.assert_allclose(states[-1].setpoint, path.end, atol=1e-9)
    assert np.degrees(max(state.setpoint[0] for state in states)) == pytest.approx(30.0, abs=0.05)
    assert off_path(rest, after_return(rest, states)) < 5e-3


def test_contact_is_refused_with_its_time_and_the_parts(stage: Stage) -> None:
    rows = [[100.0 + t, *angles] for t, *angles in swing(4.0, 40.0)]
    q = np.radians((40.0, *READY[1:]))
    with pytest.raises(ScriptError) as caught:
        stage.planned(script(rows), with_box(stage, q))
    text = str(caught.value)
    assert "line 2" in text
    assert " and box would " in text
    moment = float(text.split("blocked at ")[1].split(maxsplit=1)[0])
    # The box is at the turning point, after 2 s.
    assert 101.0 < moment < 102.0


@pytest.mark.parametrize(
    ("rows", "why"),
    [
        ([[0, *READY]], "2 to 1200 values"),
        (
            [[0, *READY], [0, 5, *READY[1:]]],
            r"Row 2 has the time 0 s\. .* later than that of the row before",
        ),
        ([[0, *READY], [1, *READY]], "moves nothing"),
        ([[0, *READY], [1, *READY[:4]]], "a time and 5 angles, as in the first row"),
        ([[0, *READY[:1]], [1, *READY[:1]]], "the angles of all joints"),
        ([[0, *READY[:4]], [1, 5, *READY[1:4]]], "5 joints; a row of this has 4 angles"),
        ([[0, *READY], [1, 0, 30, *READY[2:]]], "axis 2 would be"),
        ([[-1, *READY], [1, 5, *READY[1:]]], "is not between 0"),
    ],
)
def test_mistakes_are_named(stage: Stage, rows: list[list[float]], why: str) -> None:
    with pytest.raises(ScriptError, match=why):
        stage.planned(script(rows))


@pytest.mark.parametrize("through", ["5", "[1, 2]", "{a: 1}", "text", "[[], []]"])
def test_what_is_no_list_of_rows_is_refused(through: str) -> None:
    with pytest.raises(ScriptError, match="Expected a"):
        parse(f"steps:\n  - trajectory: {{through: {through}}}\n")


def test_derivatives_are_those_of_the_path(stage: Stage) -> None:
    rows = np.array(swing(2.0))
    path = TrajectoryPath(stage.plan_context.arm.chain, rows[:, 0], np.radians(rows[:, 1:]))
    sigma, step = np.array([0.21, 0.5, 0.77]), 1e-5
    q, first, second, _ = joint_derivatives(path, sigma)
    low, high = (joint_derivatives(path, sigma + side)[0] for side in (-step, step))
    np.testing.assert_allclose((high - low) / (2.0 * step), first, atol=1e-7)
    np.testing.assert_allclose((high - 2.0 * q + low) / step**2, second, atol=1e-3)
    with pytest.raises(InputError, match="two postures"):
        TrajectoryPath(path.chain, path.times[:1], path.postures[:1])


def test_fingers_must_hold_what_is_named(stage: Stage) -> None:
    text = "steps:\n  - gripper: open\n  - gripper: {to: closed, holding: cup}\n"
    with pytest.raises(ScriptError, match="hold nothing instead of cup"):
        stage.planned(text)


@pytest.mark.parametrize(
    "step",
    [
        "line: {by: {z: -0.05 m}, feed: 20}",
        "lines: {through: [{x: 340, y: 0, z: 150}, {x: 340, y: 40, z: 150}], feed: 20}",
        "arc: {centre: {x: 340, y: 0, z: 170}, axis: x, angle: 60, feed: 20}",
        "circle: {centre: {x: 340, y: 0, z: 170}, normal: x, radius: 20, feed: 20}",
    ],
)
def test_feed_bounds_the_speed_of_the_tool_point(stage: Stage, step: str) -> None:
    begin = stage.begin()
    text = (
        f"frame: base\nsteps:\n  - move: {{x: 340, y: 0, z: 190, pitch: 50, roll: 0}}\n  - {step}\n"
    )
    program = stage.planned(text, begin)
    _, states = stage.play(program, begin, 20_000)
    chain = stage.plan_context.arm.chain
    points = forward_batch(chain, np.array([state.setpoint for state in states]))[:, :3, 3]
    speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) / TICK
    assert speeds[-100:].max() < 0.0201
    assert np.median(speeds[-150:-50]) == pytest.approx(0.02, rel=0.01)
