"""Scripts for arms outside the five-axis family: places, lines, arcs, circles and screws."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.extensions.programs.building.plan_state import UntimedPath
from katana450.extensions.programs.language.scope import StepTarget
from katana450.extensions.programs.planning.curve_path import PosePath
from katana450.extensions.programs.steps.moves import Home, Joints, Move, Nudge, Via
from katana450.maths.geometry import so3
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.path import joint_derivatives
from tests.general_arms.driven import begun, pose, session_of, settled
from tests.general_arms.programs import (
    NANOMETRE,
    REST,
    SOME,
    angles_of,
    begin_plan,
    every,
    length,
    middle,
    on_paths,
    plans,
    played,
    point,
    program,
)
from tests.general_arms.published_arms import KR_6, OPENMANIPULATOR_X, PANDA, SKEWED_6, UR5E


@every(SOME, REST)
def test_move_to_a_point_keeps_the_orientation_and_is_followed(chain: Chain) -> None:
    plan_state = begin_plan(chain)
    session = plan_state.plan_context.session
    start = plan_state.state
    T = pose(session, start)
    place = T[:3, 3] + (0.0, 0.02, -0.02)
    plan_state = Move(StepTarget(position=place)).build(plan_state)
    _, untimed = plan_state.actions[-1]
    assert isinstance(untimed, UntimedPath)
    reached = pose(session, settled(session, start, [cmd.Follow(untimed.timed().plan)]))
    np.testing.assert_allclose(reached[:3, 3], place, atol=1e-6)
    if chain.n >= 6:
        assert so3.angle(reached[:3, :3], T[:3, :3]) < 1e-6


@every(SOME, {})
def test_joints_nudge_via_and_home_are_planned(chain: Chain) -> None:
    plan_state = begin_plan(chain)
    q = np.array(plan_state.q)
    turned = q + 0.1
    plan_state = Joints(turned).build(plan_state)
    np.testing.assert_allclose(plan_state.q, turned, atol=1e-9)
    plan_state = Nudge(0, -0.2).build(plan_state)
    assert plan_state.q[0] == pytest.approx(turned[0] - 0.2)
    plan_state = Via((StepTarget(joints=q + 0.05), StepTarget(joints=q - 0.05)), 0.5).build(
        plan_state
    )
    np.testing.assert_allclose(plan_state.q, q - 0.05, atol=1e-9)
    plan_state = Home().build(plan_state)
    np.testing.assert_allclose(plan_state.q, q, atol=1e-9)


@every(SOME, REST)
def test_line_is_straight_and_keeps_the_orientation_at_every_tick(chain: Chain) -> None:
    compiled_program = program(
        chain, f"line: {{by: {{y: {length(chain)}, z: {-0.5 * length(chain)}}}}}"
    )
    states = played(chain, compiled_program)
    start = forward_batch(chain, states[0].setpoint[None])[0]
    end = forward_batch(chain, states[-1].setpoint[None])[0]
    by = 1e-3 * length(chain) * np.array((0.0, 1.0, -0.5))
    np.testing.assert_allclose(end[:3, 3] - start[:3, 3], by, atol=NANOMETRE)
    direction = by / np.linalg.norm(by)
    ticks = on_paths(states)
    assert len(ticks) > 30
    for T, (path, sigma, q) in zip(
        forward_batch(chain, np.array([q for *_, q in ticks])), ticks, strict=True
    ):
        off = T[:3, 3] - start[:3, 3]
        assert np.linalg.norm(off - (off @ direction) * direction) < NANOMETRE
        if chain.n >= 6:
            assert so3.angle(T[:3, :3], start[:3, :3]) < 1e-9
        else:
            assert path.turned_off(np.array([sigma]), q[None])[0] < 1e-9
    # Half-way between two ticks a drive that moves straight in its joints is beside the line.
    q = np.array([q for *_, q in ticks])
    off = forward_batch(chain, 0.5 * (q[:-1] + q[1:]))[:, :3, 3] - start[:3, 3]
    assert np.linalg.norm(off - np.outer(off @ direction, direction), axis=1).max() < 1e-4


@pytest.mark.cases(2)
@every(SOME, REST)
@pytest.mark.parametrize("normal", ["x", "[0.2, 1, 1]"])
def test_circle_closes_in_the_tool_and_in_the_joints(chain: Chain, normal: str) -> None:
    radius = 0.4 * length(chain)
    centre = point(middle(chain) - (radius, 0.0, 0.0))
    compiled_program = program(
        chain, f"circle: {{centre: {centre}, normal: {normal}, radius: {radius}}}"
    )
    path = plans(compiled_program)[-1].segments[0].path
    assert isinstance(path, PosePath)
    np.testing.assert_allclose(path.end, path.start, atol=1e-9)
    sigma = np.linspace(0.0, 1.0, 777)
    q = joint_derivatives(path, sigma)[0]
    T = forward_batch(chain, q)
    off = T[:, :3, 3] - 1e-3 * (middle(chain) - (radius, 0.0, 0.0))
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), 1e-3 * radius, atol=NANOMETRE)
    axis = np.array((1.0, 0.0, 0.0)) if normal == "x" else np.array((0.2, 1.0, 1.0))
    np.testing.assert_allclose(off @ axis, 0.0, atol=NANOMETRE)
    assert path.turned_off(sigma, q).max() < 1e-9


@pytest.mark.cases(1)
@every({"UR5e": UR5E, "KR 6": KR_6, "Panda": PANDA}, {"skewed 6": SKEWED_6})
def test_pose_with_an_orientation_is_taken_and_the_line_turns_to_it(chain: Chain) -> None:
    T = pose(session_of(chain), begun(session_of(chain)))
    R = so3.exp(np.array((0.1, -0.2, 0.15))) @ T[:3, :3]
    angles = angles_of(R)
    p = middle(chain) - (0.4 * length(chain), 10.0, 10.0)
    for text in (f"move: {point(p)[:-1]}, {angles}}}", f"line: {{to: {point(p)}, {angles}}}"):
        reached = forward_batch(chain, plans(program(chain, text))[-1].end[None])[0]
        np.testing.assert_allclose(reached[:3, 3], 1e-3 * p, atol=2e-9)
        np.testing.assert_allclose(reached[:3, :3], R, atol=1e-9)
    # On the line the tool turns about one axis, evenly.
    path = plans(program(chain, text))[-1].segments[0].path
    half = forward_batch(chain, joint_derivatives(path, np.array([0.5]))[0])[0]
    expected = so3.exp(0.5 * so3.log(R @ T[:3, :3].T)) @ T[:3, :3]
    np.testing.assert_allclose(half[:3, :3], expected, atol=1e-9)


@every({"UR5e": UR5E}, {"KR 6": KR_6, "Panda": PANDA})
def test_one_angle_changes_and_the_others_stay(chain: Chain) -> None:
    before = so3.to_rpy(pose(session_of(chain), begun(session_of(chain)))[:3, :3])
    end = plans(program(chain, f"line: {{yaw: {math.degrees(before[2]) + 15.0}}}"))[-1].end
    after = so3.to_rpy(forward_batch(chain, end[None])[0][:3, :3])
    np.testing.assert_allclose(after[:2], before[:2], atol=1e-9)
    assert after[2] - before[2] == pytest.approx(math.radians(15.0), abs=1e-9)


def test_four_axes_have_a_pitch_wherever_the_tool_goes() -> None:
    chain = OPENMANIPULATOR_X
    p = middle(chain) - (20.0, -60.0, 20.0)
    # The frame of this tool lies on its side and turns about its y axis.
    now = so3.to_rpy(pose(session_of(chain), begun(session_of(chain)))[:3, :3])
    compiled_program = program(
        chain, f"move: {point(p)[:-1]}, pitch: 25}}", "line: {by: {y: -40}, pitch: 5}"
    )
    one, two = (forward_batch(chain, plan.end[None])[0] for plan in plans(compiled_program))
    np.testing.assert_allclose(one[:3, 3], 1e-3 * p, atol=2e-9)
    np.testing.assert_allclose(two[:3, 3] - one[:3, 3], (0.0, -0.04, 0.0), atol=2e-9)
    for T, pitch in ((one, 25.0), (two, 5.0)):
        roll, angle, _ = so3.to_rpy(T[:3, :3])
        assert math.degrees(angle) == pytest.approx(pitch, abs=1e-6)
        assert abs(math.remainder(roll - now[0], math.tau)) < 1e-9


@pytest.mark.cases(2)
@every(SOME, {})
def test_lines_and_arc_are_planned(chain: Chain) -> None:
    p, d = middle(chain), 0.3 * length(chain)
    corners = [p - (0.0, -d, 0.0), p - (0.0, -d, d), p - (0.0, 0.0, d)]
    compiled_program = program(
        chain,
        f"lines: {{through: [{', '.join(map(point, corners))}]}}",
        f"lines: {{through: [{point(p)}, {point(corners[0])}], blend: 0}}",
        f"arc: {{centre: {point(p)}, axis: x, angle: 45, climb: 5}}",
        "home",
    )
    blended = plans(compiled_program)[0].segments[0].path
    np.testing.assert_allclose(
        forward_batch(chain, blended.end[None])[0, :3, 3], 1e-3 * corners[-1], atol=2e-9
    )
    assert isinstance(blended, PosePath)
    assert len(blended.joins) >= 4
    assert len(plans(compiled_program)[1].segments) == 2
    # The corner is rounded: the path passes beside it.
    sigma = np.linspace(0.0, 1.0, 1000)
    points = 1e3 * forward_batch(chain, joint_derivatives(blended, sigma)[0])[:, :3, 3]
    distance = np.linalg.norm(points - corners[0], axis=1).min()
    assert 0.02 * d < distance < 0.3 * d
    end = forward_batch(chain, plans(compiled_program)[2].end[None])[0, :3, 3]
    turn = so3.rotation_x(math.radians(45.0)) @ (corners[0] - p)
    np.testing.assert_allclose(1e3 * end, p + turn + (5.0, 0.0, 0.0), atol=1e-5)


def test_arm_angle_turns_where_it_must() -> None:
    # With the arm angle at a limit of the way, the line is possible only if it turns.
    path = plans(program(PANDA, "line: {by: {x: 280}}"))[0].segments[0].path
    end = forward_batch(PANDA, path.end[None])[0, :3, 3]
    np.testing.assert_allclose(1e3 * end, middle(PANDA) + np.array((280.0, 0, 0)), atol=1e-5)
    assert abs(path.end[6] - path.start[6]) > math.radians(10.0)
    assert PANDA.within_limits(path.end)


@pytest.mark.cases(1)
@every({"UR5e": UR5E, "OpenMANIPULATOR-X": OPENMANIPULATOR_X}, {"Panda": PANDA})
def test_trajectory_of_all_joints_is_followed(chain: Chain) -> None:
    q = np.degrees(begin_plan(chain).q)
    rows = [[0.5 * number, *(q + 5.0 * number).tolist()] for number in range(4)]
    compiled_program = program(chain, f"trajectory: {{through: {rows}}}")
    np.testing.assert_allclose(
        played(chain, compiled_program)[-1].setpoint, np.radians(q + 15.0), atol=1e-9
    )
