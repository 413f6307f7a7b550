"""Priorities and branches: the choices of a person, and their effect on the arm."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.tool_targets import branch_options
from katana450.arm.control.state.findings import of_projection
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.modes import JointTarget
from katana450.arm.control.state.state import Reason, State, Status
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import project
from katana450.maths.kinematics.tool import ToolTarget, pitch_and_roll

TICK = 0.01
SPLIT = np.array([0.4353, 0.0, 0.0323])
"""A place that front-up reaches with pitches in two ranges, and the direction across its edge."""
SPLIT_PITCH = -0.205
ACROSS = np.array([-0.81, 0.0, -0.586])
OUT, _, UP = np.eye(3)


def take(session: Session, state: State, *commands: cmd.Command) -> State:
    return session.step(state, commands, state.t + TICK)


def reasons(state: State) -> list[Reason]:
    return [finding.reason for finding in state.findings]


def point(arm: ArmModel, q: FloatArray) -> FloatArray:
    return forward(arm.chain, q)[:3, 3]


def at_the_edge(session: Session, state: State) -> State:
    """Return the state of a slow drag to the place where the limits stop the pitch."""
    T = se3.from_rotation_translation(so3.rotation_y(SPLIT_PITCH), SPLIT - 0.02 * ACROSS)
    before = take(session, state, cmd.Pose(T), cmd.EndDrag())
    assert before.status is Status.OK
    for along in np.arange(-0.02, 0.02, 5e-4):
        before = take(session, before, cmd.Position(SPLIT + along * ACROSS))
    return before


def test_gap_is_reported_with_axis_and_leap(session: Session, state: State) -> None:
    held = at_the_edge(session, state)
    assert held.status is Status.GAP
    first = held.findings[0]
    assert first.reason is Reason.ACROSS_GAP
    assert first.axis in (1, 3)
    assert first.amount > 1.0
    # The position is not out of reach, so no such finding is reported.
    assert Reason.OUT_OF_REACH not in reasons(held)


def test_branch_change_crosses_a_gap(arm: ArmModel, session: Session, state: State) -> None:
    held = at_the_edge(session, state)
    across = take(session, held, cmd.Branch(name=str(held.branch)))
    assert across.branch == held.branch
    assert np.abs(across.goal - held.goal).max() > 1.0
    desired = SPLIT + 0.0195 * ACROSS
    assert np.allclose(point(arm, across.goal), desired, atol=1e-9)
    assert across.status is Status.LIMITED
    assert isinstance(across.target, ToolTarget)
    # The drag continues from there.
    on = take(session, across, cmd.Position(desired + 0.001 * ACROSS))
    assert np.abs(on.goal - across.goal).max() < 0.1
    assert on.status is not Status.GAP


@pytest.mark.parametrize("branch", BRANCHES, ids=str)
def test_branch_change_keeps_limits_and_joint_speed(
    arm: ArmModel, session: Session, state: State, branch: Branch
) -> None:
    """The place high over the base is reached by all four branches."""
    T = se3.from_rotation_translation(so3.rotation_y(-1.3), np.array([0.03, 0.0, 0.42]))
    state = take(session, state, cmd.Pose(T), cmd.EndDrag())
    option = branch_options(arm, state)[BRANCHES.index(branch)]
    target = take(session, state, cmd.Branch(name=str(branch)))
    assert target.branch == branch
    assert isinstance(target.target, JointTarget)
    assert np.allclose(target.goal, option.q, atol=1e-12)
    while target.moving:
        before = target.setpoint
        target = take(session, target)
        step = np.abs(target.setpoint - before)
        assert (step <= arm.chain.speed * TICK * (1 + 1e-9)).all()
        assert arm.chain.within_limits(target.setpoint, slack=0.0)
    on = branch_of(arm.chain, target.setpoint)
    assert on == branch
    # Later drags keep the new branch.
    dragged = take(session, target, cmd.Position(point(arm, target.goal) - 0.01 * UP))
    assert dragged.branch == branch
    assert branch_of(arm.chain, dragged.goal) == branch


def test_target_is_kept_on_the_other_shoulder(
    arm: ArmModel, session: Session, state: State
) -> None:
    """Pitch and roll are counted in the arm's plane, which then faces the other way."""
    desired = np.array([0.05, 0.02, 0.40])
    for fraction in np.linspace(0.05, 1.0, 20):
        start = point(arm, session.ready)
        state = take(session, state, cmd.Position(start + fraction * (desired - start)))
    assert isinstance(state.target, ToolTarget)
    back = take(session, state, cmd.Branch(name="back-up"))
    assert isinstance(back.target, ToolTarget)
    for after in (state, back):
        assert isinstance(after.target, ToolTarget)
    T, T_back = (
        target.pose(arm.chain, target.facing(arm.chain, branch, 0.0))  # type: ignore[arg-type]
        for target, branch in ((state.target, state.branch), (back.target, back.branch))
    )
    assert np.allclose(T, T_back, atol=1e-12)


def test_branch_options_predict_the_result_of_taking_them(
    arm: ArmModel, session: Session, state: State
) -> None:
    state = take(session, state, cmd.Position(point(arm, state.goal) + 0.05 * UP))
    for branch, option in zip(BRANCHES, branch_options(arm, state), strict=True):
        assert option.contact is None
        target = take(session, state, cmd.Branch(name=str(branch)))
        assert option.branch == branch
        assert np.allclose(target.goal, option.q, atol=1e-12)
        assert option.within_limits
        assert option.distance == np.abs(option.q - state.q).max()
        assert option.time == (np.abs(option.q - state.q) / arm.chain.speed).max()


# The arm cannot have the pitch of the target at this position, nor its yaw at any position.
SIDEWAYS = so3.rotation_z(0.5) @ so3.rotation_y(1.2)
FAR_OUT = np.array([0.55, 0.0, 0.0])


@pytest.mark.parametrize(
    ("priority", "held", "given_up"),
    [
        (Priority.POSE, "position", {Reason.YAW_FIXED, Reason.PITCH_CHANGED}),
        (Priority.PITCH, "pitch", {Reason.YAW_FIXED, Reason.POSITION_CHANGED}),
        (Priority.POSITION, "position", {Reason.YAW_FIXED, Reason.PITCH_CHANGED}),
    ],
)
def test_each_priority_keeps_its_part_and_reports_what_is_lost(
    arm: ArmModel,
    session: Session,
    state: State,
    priority: Priority,
    held: str,
    given_up: set[Reason],
) -> None:
    T = se3.from_rotation_translation(SIDEWAYS, FAR_OUT)
    state = take(session, state, cmd.SetPriority(priority), cmd.Pose(T))
    assert state.priority is priority
    assert given_up <= set(reasons(state))
    assert set(reasons(state)) <= given_up | {Reason.AXIS_LIMIT, Reason.LINKS}
    if held == "position":
        assert np.allclose(point(arm, state.goal), FAR_OUT, atol=1e-9)
    else:
        assert pitch_and_roll(session.require_arm().chain, state.goal)[0] == pytest.approx(
            1.2, abs=1e-9
        )
        (gap,) = (f.amount for f in state.findings if f.reason is Reason.POSITION_CHANGED)
        assert gap == pytest.approx(math.dist(point(arm, state.goal), FAR_OUT), abs=1e-12)


def test_lost_pitch_is_reported_also_out_of_reach(session: Session) -> None:
    narrow = np.full(5, math.radians(20.0))
    chain = dataclasses.replace(session.require_arm().chain, lower=-narrow, upper=narrow)
    T = se3.from_rotation_translation(so3.rotation_y(math.pi / 2.0), np.array((1.0, 0.0, 0.0)))
    p = project(chain, T, priority=Priority.PITCH)
    assert p.pitch_error > 0.1
    findings = of_projection(chain, p, Priority.PITCH, yaw_was_given=True)
    amounts = {finding.reason: finding.amount for finding in findings}
    assert amounts[Reason.OUT_OF_REACH] == p.position_error
    assert amounts[Reason.PITCH_CHANGED] == p.pitch_error
    assert all(finding_text(finding) for finding in findings)


def test_new_priority_reapplies_the_target_or_changes_nothing(
    session: Session, state: State
) -> None:
    reread = take(session, state, cmd.SetPriority(Priority.PITCH))
    assert (reread.goal == state.goal).all()
    assert not reread.moving
    T = se3.from_rotation_translation(SIDEWAYS, FAR_OUT)
    posed = take(session, state, cmd.Pose(T))
    reread = take(session, posed, cmd.SetPriority(Priority.PITCH))
    assert reread.target is posed.target
    assert pitch_and_roll(session.require_arm().chain, reread.goal)[0] == pytest.approx(
        1.2, abs=1e-9
    )
    back = take(session, reread, cmd.SetPriority(Priority.POSE))
    assert np.allclose(back.goal, posed.goal, atol=1e-9)


def test_roll_beyond_its_limit_is_reported_as_roll(
    arm: ArmModel, session: Session, state: State
) -> None:
    _, roll = pitch_and_roll(session.require_arm().chain, state.goal)
    turn = cmd.Turn(pitch_and_roll(session.require_arm().chain, state.goal)[0], roll + 3.05)
    state = take(session, state, turn)
    while state.since is not None:
        state = take(session, state)
    assert reasons(state) == [Reason.ROLL_CHANGED, Reason.AXIS_LIMIT]
    assert state.findings[0].amount == pytest.approx(3.05 - arm.chain.upper[4], abs=1e-6)
    assert state.findings[1].axis == 4
