"""The session: the effect of commands on the arm, and the speed of its motion."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import JointTarget, PoseTarget
from katana450.arm.control.state.state import Reason, State, Status, Verdict
from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import pitch_and_roll
from tests.ticks import TICK, ticked


def tool_point(arm: ArmModel, state: State, q: FloatArray | None = None) -> FloatArray:
    return forward(arm.chain_to(state.tool), state.goal if q is None else q)[:3, 3]


def reasons(state: State) -> set[Reason]:
    return {finding.reason for finding in state.findings}


def test_far_target_is_approached_at_maximum_speed(arm: ArmModel, state: State) -> None:
    session = Session(arm, state.setpoint, tool_speed=9.0)
    state = session.step(state, [cmd.Joint(1, 2.0)], TICK)
    ticks = 1
    while state.moving:
        before = state.setpoint
        state = session.step(state, [], state.t + TICK)
        assert (np.abs(state.setpoint - before) <= arm.chain.speed * TICK * (1 + 1e-9)).all()
        ticks += 1
    # The arm accelerates with bounded jerk, cruises, and decelerates in the same manner.
    v, a, j = (limit[0] for limit in (arm.chain.speed, arm.limits.acceleration, arm.limits.jerk))
    assert ticks * TICK == pytest.approx(2.0 / v + v / a + a / j, abs=2 * TICK)
    assert state.setpoint[0] == 2.0


def test_nothing_moves_while_time_stands_or_runs_back(session: Session, state: State) -> None:
    for t in (0.0, -5.0):
        after = session.step(state, [cmd.Joint(1, 2.0)], t)
        assert (after.setpoint == state.setpoint).all()
        assert after.t == 0.0


def test_moving_the_tool_keeps_pitch_and_roll_without_a_yaw(
    arm: ArmModel, session: Session, state: State
) -> None:
    state = ticked(session, state, cmd.Turn(0.6, 0.4), ticks=5)
    desired = np.array([0.25, 0.25, -0.05])
    state = ticked(session, state, cmd.Position(desired), ticks=5)
    assert np.allclose(tool_point(arm, state), desired, atol=1e-12)
    assert pitch_and_roll(session.require_arm().chain, state.goal) == pytest.approx(
        (0.6, 0.4), abs=1e-12
    )
    assert state.status is Status.OK


def test_turning_the_tool_keeps_its_position(arm: ArmModel, session: Session, state: State) -> None:
    before = tool_point(arm, state)
    state = ticked(session, state, cmd.Turn(0.55, -1.0), ticks=5)
    assert np.allclose(tool_point(arm, state), before, atol=1e-12)
    assert pitch_and_roll(session.require_arm().chain, state.goal) == pytest.approx(
        (0.55, -1.0), abs=1e-12
    )


def test_lost_yaw_of_a_pose_is_reported(arm: ArmModel, session: Session, state: State) -> None:
    R = so3.rotation_z(math.radians(23.0)) @ so3.rotation_y(0.5)
    T = se3.from_rotation_translation(R, np.array([0.35, 0.0, 0.0]))
    state = ticked(session, state, cmd.Pose(T))
    assert isinstance(state.target, PoseTarget)
    assert np.allclose(tool_point(arm, state), T[:3, 3], atol=1e-12)
    (yaw,) = (f for f in state.findings if f.reason is Reason.YAW_FIXED)
    expected = math.asin(abs(R[1, 0]))  # the tool's x axis against the plane y = 0
    assert yaw.amount == pytest.approx(expected, abs=1e-12)


def test_goal_out_of_reach_is_the_nearest_point_with_a_finding(
    arm: ArmModel, session: Session, state: State
) -> None:
    far = np.array([0.9, 0.0, 0.1])
    state = ticked(session, state, cmd.Position(far), ticks=10)
    reached = tool_point(arm, state)
    lengths = float(np.linalg.norm(arm.tools["tcp"][:3, 3]))
    assert np.linalg.norm(reached) == pytest.approx(lengths, abs=1e-9)
    assert np.allclose(np.cross(reached, far), 0.0, atol=1e-9)
    (gap,) = (f for f in state.findings if f.reason is Reason.OUT_OF_REACH)
    assert gap.amount == pytest.approx(np.linalg.norm(far) - lengths, abs=1e-9)
    # The reach of the links is the constraint; no axis is at a limit.
    assert [f.reason for f in state.findings] == [Reason.OUT_OF_REACH, Reason.LINKS]
    assert state.status is Status.LIMITED


def test_drag_back_into_reach_restores_the_target_pitch(session: Session, state: State) -> None:
    home = ticked(session, state, cmd.Position(np.array([0.44, 0.0, 0.0])), ticks=5)
    pitch, _ = pitch_and_roll(session.require_arm().chain, home.goal)
    away = ticked(session, home, cmd.Position(np.array([0.9, 0.0, 0.0])), ticks=50)
    assert abs(pitch_and_roll(session.require_arm().chain, away.goal)[0] - pitch) > 0.3
    back = ticked(session, away, cmd.Position(np.array([0.44, 0.0, 0.0])), ticks=10)
    assert pitch_and_roll(session.require_arm().chain, back.goal)[0] == pytest.approx(
        pitch, abs=1e-12
    )


def test_end_of_a_drag_makes_the_goal_the_target_and_keeps_the_finding(
    session: Session, state: State
) -> None:
    away = ticked(session, state, cmd.Position(np.array([0.9, 0.0, 0.0])), ticks=10)
    assert not isinstance(away.target, JointTarget)
    away = ticked(session, away, cmd.EndDrag())
    assert isinstance(away.target, JointTarget)
    assert away.target.q is away.goal
    assert reasons(away) == {Reason.OUT_OF_REACH, Reason.LINKS}
    # The next target starts from the posture of the arm, and clears the reason.
    back = ticked(session, away, cmd.Turn(*pitch_and_roll(session.require_arm().chain, away.goal)))
    assert np.allclose(back.goal, away.goal, atol=1e-6)
    assert reasons(back) == set()


def test_drag_that_ends_at_once_still_reaches_its_target(
    arm: ArmModel, session: Session, state: State
) -> None:
    """One tick cannot track all of the path; the target remains after the end of the drag."""
    desired = np.array([-0.2, 0.35, 0.1])
    released = ticked(session, state, cmd.Position(desired), cmd.EndDrag())
    assert released.since is not None
    assert released.findings == ()
    assert math.dist(tool_point(arm, released), desired) > 0.1
    arrived = ticked(session, released, ticks=15)
    assert arrived.since is None
    assert np.allclose(tool_point(arm, arrived), desired, atol=1e-12)
    assert isinstance(arrived.target, JointTarget)
    assert arrived.target.q is arrived.goal
    # A new drag on the way replaces the target.
    again = ticked(session, released, cmd.Position(desired), ticks=15)
    assert np.allclose(tool_point(arm, again), desired, atol=1e-12)
    assert not isinstance(again.target, JointTarget)
    # Any other command ends the drag.
    for command in (cmd.Hold(), cmd.Home(), cmd.Joint(1, 0.1), cmd.Tool("flange")):
        ended = ticked(session, released, command)
        assert ended.since is None
        assert isinstance(ended.target, JointTarget)
        assert (ticked(session, ended, ticks=3).goal == ended.goal).all()


@pytest.mark.parametrize("axis", range(5))
def test_slider_at_its_end_makes_no_finding(
    arm: ArmModel, session: Session, state: State, axis: int
) -> None:
    end = math.radians(math.degrees(arm.chain.upper[axis]))
    state = ticked(session, state, cmd.Joint(axis + 1, math.nextafter(end, math.inf)))
    assert state.findings == ()
    assert state.goal[axis] <= arm.chain.upper[axis]


@pytest.mark.parametrize("axis", range(5))
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_joint_stops_at_its_limit_and_reports_it(
    arm: ArmModel, session: Session, state: State, axis: int, side: float
) -> None:
    state = ticked(session, state, cmd.Joint(axis + 1, side * 4.0))
    limit = (arm.chain.upper if side > 0 else arm.chain.lower)[axis]
    assert state.goal[axis] == limit
    (finding,) = state.findings
    assert (finding.reason, finding.axis) == (Reason.AXIS_LIMIT, axis)
    assert finding.amount == limit
    # The target stays, so that another limit would be kept from the same target.
    assert isinstance(state.target, JointTarget)
    assert state.target.q[axis] == side * 4.0


def test_zero_posture_hold_and_home(session: Session, state: State) -> None:
    state = ticked(session, state, cmd.GoToZero())
    assert (state.goal == 0.0).all()
    state = ticked(session, state, ticks=20)
    assert state.moving
    held = ticked(session, state, cmd.Hold(), ticks=100)
    assert not held.moving
    assert (held.goal == held.setpoint).all()
    home = ticked(session, held, cmd.Home())
    assert (home.goal == session.ready).all()


def test_tool_change_moves_nothing(arm: ArmModel, session: Session, state: State) -> None:
    changed = ticked(session, state, cmd.Tool("flange"))
    assert (changed.goal == state.goal).all()
    assert not changed.moving
    moved = ticked(session, changed, cmd.Position(np.array([0.25, 0.0, 0.05])), ticks=5)
    assert np.allclose(forward(arm.chain_to("flange"), moved.goal)[:3, 3], [0.25, 0.0, 0.05])


def test_gripper_moves_at_its_speed_and_stops_at_its_limit(
    arm: ArmModel, session: Session, state: State
) -> None:
    state = ticked(session, state, cmd.Gripper(1.0))
    assert state.gripper_goal == arm.gripper.upper
    assert reasons(state) == {Reason.GRIPPER_LIMIT}
    assert 0.0 < state.gripper_setpoint <= arm.gripper.speed * TICK * (1 + 1e-12)
    state = ticked(session, state, ticks=100)
    assert state.gripper_setpoint == arm.gripper.upper
    # A command of the arm keeps the gripper's finding; a valid gripper command clears it.
    state = ticked(session, state, cmd.Home())
    assert reasons(state) == {Reason.GRIPPER_LIMIT}
    assert reasons(ticked(session, state, cmd.Gripper(0.0))) == set()


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (cmd.Joint(6, 0.0), "no axis 6"),
        (cmd.Joints(np.zeros(6)), "5 joints"),
        (cmd.Tool("hammer"), "hammer.*tcp, grasp, flange"),
        (cmd.Tool([]), "no tool"),  # type: ignore[arg-type]
    ],
)
def test_unsupported_request_changes_nothing(
    session: Session, state: State, command: cmd.Command, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        session.check(command)
    with pytest.raises(InputError, match=message):
        session.step(state, [cmd.Joint(1, 1.0), command], TICK)
    assert (state.goal == session.ready).all()


def test_ready_posture_outside_the_limits_is_refused(arm: ArmModel) -> None:
    with pytest.raises(InputError, match="limits"):
        Session(arm, np.full(5, 2.0))


def test_limit_of_a_drag_is_no_outcome_of_the_gripper_or_the_speed(
    session: Session, state: State
) -> None:
    others: list[cmd.Command] = [cmd.Gripper(0.1), cmd.Speed(0.9)]
    far = cmd.Position(np.array([0.9, 0.0, 0.1]))
    verdicts = []
    before = away = ticked(session, state, far)
    while away.status is Status.OK:
        before, away = away, ticked(session, away, *others)
        verdicts += [outcome.verdict for outcome in away.outcomes]
    assert len(verdicts) > 2
    assert set(verdicts) == {Verdict.ACCEPTED}
    # In the tick that reaches the limit, a drag is limited and not what follows it.
    beyond = ticked(session, before, far, *others)
    assert [outcome.verdict for outcome in beyond.outcomes] == [
        Verdict.LIMITED,
        *2 * [Verdict.ACCEPTED],
    ]
