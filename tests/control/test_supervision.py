"""Check the supervision of a measured arm: what stops it, and that it stays where it stopped."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import clear_refusal
from katana450.arm.control.session.supervision import CONTACT_DISTANCE
from katana450.arm.control.state.arm_report import (
    ACTS,
    HAZARDS,
    ArmAct,
    ArmMode,
    ArmReport,
    MeasuredStop,
)
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import Reason, State, Verdict
from katana450.arm.drivers.driver import DriverAnswer
from katana450.arm.runtime.tick import failed, stepped, waited
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import JointMotion

TICK = 0.01
DELAY = 20
"""Ticks by which the arm of these tests is behind its setpoint."""


@dataclass
class DelayedArm:
    """An arm that follows its setpoints 0.2 s later, as a driver that sends ahead does.

    Attributes:
        mode: mode that it reports while it follows.
        q: measured joints.
        offset: what is added to the measurement, as if something held the arm [rad].
        silent: whether its measurements have ended.
    """

    mode: ArmMode
    q: FloatArray
    offset: float = 0.0
    silent: bool = False
    note: str = ""
    measured_stop: MeasuredStop | None = None

    def __post_init__(self) -> None:
        self.sent: list[FloatArray] = []
        self.t = 0.0
        self.frozen: FloatArray | None = None

    def send(self, q: FloatArray, gripper: float, t: float, stopped: bool = False) -> DriverAnswer:
        self.t = self.t if self.silent else t
        if self.frozen is None and stopped:
            self.frozen = self.q
        elif not stopped:
            self.frozen = None
        self.sent.append(q if self.frozen is None else self.frozen)
        due = self.sent[max(len(self.sent) - DELAY, 0)] if self.mode.follows else self.q
        moves = self.mode.follows and not np.array_equal(due, self.sent[-1])
        self.q = frozen(due if self.frozen is None else self.frozen)
        return DriverAnswer(
            frozen(self.q + self.offset),
            gripper,
            ArmReport(
                ArmMode.MOVING if moves and self.frozen is None else self.mode,
                self.t,
                np.append(self.q, gripper),
                note=self.note,
                measured_stop=self.measured_stop,
            ),
        )


@pytest.fixture
def session(shipped: Session) -> Session:
    return shipped


@pytest.fixture
def measured(session: Session) -> DelayedArm:
    return DelayedArm(ArmMode.HOLDING, session.ready)


def run(
    session: Session, arm: DelayedArm, state: State, commands: list[cmd.Command], ticks: int = 1
) -> State:
    for _ in range(ticks):
        state = stepped(session, state, commands, state.t + TICK, arm.send)
        commands = []
    return state


def reasons(state: State) -> list[Reason]:
    return [finding.reason for finding in state.findings]


def test_arm_that_lags_as_expected_reaches_its_goal(
    session: Session, measured: DelayedArm, state: State
) -> None:
    moving = run(session, measured, state, [cmd.Joint(1, 1.0)], 30)
    assert np.abs(moving.q - moving.setpoint).max() > math.radians(3.0), "the lag is not a fault"
    assert moving.stopped is None
    assert moving.moving
    arrived = run(session, measured, moving, [], 400)
    np.testing.assert_array_equal(arrived.q, arrived.goal)
    assert arrived.goal[0] == 1.0
    assert not arrived.moving
    assert arrived.stopped is None


def test_arm_moves_until_it_is_measured_at_rest(
    session: Session, measured: DelayedArm, state: State
) -> None:
    moving = run(session, measured, state, [cmd.Joint(1, 1.0)])
    while not np.array_equal(moving.setpoint, moving.goal):
        moving = run(session, measured, moving, [])
    assert moving.moving, "the setpoint is at the goal, the arm is not"


@pytest.mark.parametrize(
    "mode", [mode for mode in ArmMode if not mode.follows and mode is not ArmMode.LOST]
)
def test_arm_that_does_not_follow_is_stopped_until_it_does(
    session: Session, state: State, mode: ArmMode
) -> None:
    measured = DelayedArm(mode, frozen(session.ready + 0.1), note="Hold the arm.")
    state = run(session, measured, state, [cmd.Joint(1, 1.0)])
    state = run(session, measured, state, [cmd.Joint(1, 1.0), cmd.ClearStop()], 120)
    assert state.stopped is not None
    lasting = mode in (ArmMode.COLLIDED, ArmMode.FAULT)
    why = "Hold the arm." if lasting else "The arm was not ready for setpoints."
    assert state.stopped.cause.why == why
    assert "hold the arm" in sentence(state).lower()
    np.testing.assert_array_equal(state.setpoint, measured.q)
    np.testing.assert_array_equal(state.goal, measured.q)
    assert clear_refusal(state, state.t + 10.0) == "Hold the arm."
    measured.mode, measured.note = ArmMode.HOLDING, ""
    state = run(session, measured, state, [], 2)
    assert clear_refusal(state, state.t) == ""
    assert Reason.NOT_FOLLOWING not in reasons(state), "it follows again"
    state = run(session, measured, state, [cmd.ClearStop()], 50)
    assert state.stopped is None
    np.testing.assert_array_equal(state.q, session.ready + 0.1)
    state = run(session, measured, state, [cmd.Joint(1, 0.9)], 250)
    assert state.q[0] == 0.9


def test_stopped_arm_stays_where_it_came_to_rest(
    session: Session, measured: DelayedArm, state: State
) -> None:
    moving = run(session, measured, state, [cmd.Joint(1, 1.0)], 40)
    setpoint = moving.setpoint[0]
    stopped = run(session, measured, moving, [cmd.Stop()], 150)
    rest = stopped.q[0]
    assert rest < setpoint - math.radians(1.0), "the setpoint was ahead of the arm"
    assert stopped.setpoint[0] == stopped.goal[0] == rest
    cleared = run(session, measured, stopped, [cmd.ClearStop()], 100)
    assert cleared.stopped is None
    assert cleared.q[0] == rest
    assert not cleared.moving


def test_measured_stop_replaces_the_computed_one(
    session: Session, measured: DelayedArm, state: State
) -> None:
    moving = run(session, measured, state, [cmd.Joint(1, 1.0)], 40)
    stopped = run(session, measured, moving, [cmd.Stop()])
    assert "within" not in sentence(stopped), "the stop of the simulation is not that of the arm"
    measured.measured_stop = MeasuredStop(0.21, math.radians(1.3))
    stopped = run(session, measured, stopped, [], 2)
    assert "came to rest after 0.21 s and 1.3°, as measured" in sentence(stopped)
    cleared = run(session, measured, run(session, measured, stopped, [], 120), [cmd.ClearStop()], 2)
    assert Reason.MEASURED_STOP not in reasons(cleared)


@pytest.mark.parametrize("offset", [math.radians(3.5), -math.radians(20.0)])
def test_tracking_error_stops_the_arm(
    session: Session, measured: DelayedArm, state: State, offset: float
) -> None:
    measured.offset = offset
    soon = run(session, measured, state, [], 29)
    assert soon.stopped is None
    later = run(session, measured, soon, [], 5)
    assert later.stopped is not None
    assert Reason.TRACKING_ERROR in reasons(later)
    assert f"{abs(math.degrees(offset)):.1f}° from where it should be" in later.stopped.cause.why


def test_small_or_short_tracking_errors_do_not_stop_it(
    session: Session, measured: DelayedArm, state: State
) -> None:
    measured.offset = math.radians(2.9)
    state = run(session, measured, state, [], 100)
    for _ in range(5):
        measured.offset = math.radians(10.0)
        state = run(session, measured, state, [], 25)
        measured.offset = 0.0
        state = run(session, measured, state, [], 3)
    assert state.stopped is None


def test_arm_without_measurements_counts_as_lost(
    session: Session, measured: DelayedArm, state: State
) -> None:
    measured.silent = True
    assert run(session, measured, state, [], 49).stopped is None
    lost = run(session, measured, state, [], 60)
    assert lost.stopped is not None
    assert "may still move" in lost.stopped.cause.why


def test_contact_at_the_measured_posture_stops_the_arm(session: Session, state: State) -> None:
    world = session.world_at(state)
    assert world is not None
    touching = np.array(session.ready)
    # Lean the arm forward until it meets the table.
    while world.nearest(np.append(touching, 0.0)).distance > 0.0:  # type: ignore[union-attr]
        touching[1] -= 0.01
    near = replace(state, q=frozen(touching))
    # Where a contact is intended, as when an object is put down, it is no reason to stop.
    intended = ArmReport(ArmMode.MOVING, state.t, np.append(touching, 0.0))
    assert session.supervised(near, intended).stopped is None
    # Not astray for long enough to be stopped for that.
    report = ArmReport(ArmMode.MOVING, state.t, np.append(session.ready, 0.0))
    after = session.supervised(near, report)
    assert after.stopped is not None
    assert Reason.MEASURED_CONTACT in reasons(after)
    assert "touch, as measured" in after.stopped.cause.why


def test_intended_contact_hides_no_other_one(session: Session, state: State) -> None:
    """The arm touches the table as it should, deepest of all, and a post that it should not."""
    q = np.array((0.0, -0.6, 1.2, 0.6, 0.0))
    world = session.world_at(state)
    assert world is not None
    while (nearest := world.nearest(np.append(q, 0.0))) is not None and nearest.distance > -1e-3:
        q[1] += 0.002
    assert nearest is not None
    assert "table" in nearest.parts
    arm = next(name for name in nearest.parts if name != "table")
    # Turned about the vertical axis it touches the table in the same way.
    away = np.append(q + np.array((-0.3, 0.0, 0.0, 0.0, 0.0)), 0.0)
    assert world.gap(away, *nearest.parts) == pytest.approx(nearest.distance, abs=1e-6)
    x, y, _ = nearest.points[0]
    near = replace(state, q=frozen(q), gripper=0.0, motion=JointMotion.rest(away[:-1]))

    def at(aside: float) -> State:
        place = np.eye(4)
        place[:3, 3] = x, y + aside, 0.001
        post = SceneObject("post", Shape.BOX, (0.02, 0.02, 0.05), place)
        return replace(near, objects=(*near.objects, post))

    aside = 0.2
    while True:
        with_post = at(aside)
        bodies = session.world_at(with_post)
        assert bodies is not None
        gap = bodies.gap(with_post.x, arm, "post")
        if gap < CONTACT_DISTANCE:
            break
        # Farther than it moves, the post comes no nearer.
        aside -= max(2e-4, gap - CONTACT_DISTANCE)
    assert bodies.nearest(with_post.x).parts == nearest.parts  # type: ignore[union-attr]
    report = ArmReport(ArmMode.MOVING, state.t, away)
    assert session.supervised(near, report).stopped is None
    after = session.supervised(with_post, report)
    assert after.stopped is not None
    contact = next(f for f in after.findings if f.reason is Reason.MEASURED_CONTACT)
    assert "post" in (contact.parts or ())
    # Where both are intended, neither is a reason.
    both = ArmReport(ArmMode.MOVING, state.t, with_post.x)
    assert session.supervised(with_post, both).stopped is None


def test_acts_are_refused_for_a_simulated_arm(session: Session, state: State) -> None:
    after = session.step(state, [cmd.OperateArm(ArmAct.UNBLOCK)], state.t)
    assert after.outcomes[0].verdict is Verdict.REFUSED
    assert "simulated" in after.outcomes[0].why


@pytest.mark.parametrize("mode", ArmMode)
@pytest.mark.parametrize("act", ArmAct)
def test_each_act_is_possible_in_the_listed_modes_of_a_stopped_arm(
    session: Session, state: State, mode: ArmMode, act: ArmAct
) -> None:
    measured = DelayedArm(mode, session.ready)
    command = cmd.OperateArm(act, confirmed=True)
    state = run(session, measured, state, [])
    if state.stopped is None:
        moving = run(session, measured, state, [command])
        assert moving.outcomes[0].verdict is Verdict.REFUSED
        assert moving.outcomes[0].why.startswith("Stop the arm first")
        state = run(session, measured, moving, [cmd.Stop()], 2)
    if mode is ArmMode.MOVING:
        return
    after = run(session, measured, state, [command])
    refused = after.outcomes[0].verdict is Verdict.REFUSED
    assert refused == (act not in ACTS.get(mode, ()))
    assert not refused or f"while the arm is {mode.value}" in after.outcomes[0].why


def test_hazards_must_be_confirmed() -> None:
    for act in ArmAct:
        if act not in HAZARDS:
            cmd.OperateArm(act)
            continue
        with pytest.raises(InputError, match="Confirm this"):
            cmd.OperateArm(act)
    with pytest.raises(InputError, match="Motors off means the arm falls"):
        cmd.OperateArm(ArmAct.RELEASE)


def test_arm_at_rest_is_supervised_too(
    session: Session, measured: DelayedArm, state: State
) -> None:
    state = run(session, measured, state, [])
    measured.mode, measured.note = ArmMode.COLLIDED, "Axis 2 stopped at a collision."
    after = waited(session, state, state.t + 0.08, measured.send)
    assert after.stopped is not None
    assert after.stopped.cause.why == "Axis 2 stopped at a collision."


def test_internal_error_leaves_the_report(
    session: Session, measured: DelayedArm, state: State
) -> None:
    state = run(session, measured, state, [])
    assert failed(state, []).report is state.report
