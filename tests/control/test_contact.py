"""The arm at full speed stops before the table, itself and a cup, reports it and moves away."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.motion_stepper import met_before_rest
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import JointTarget
from katana450.arm.control.state.state import Reason, State, Status
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.geometry.curve import JointCurve
from katana450.maths.motion.limiter import JointMotion
from tests.conftest import LONG
from tests.ticks import TICK, rested, until_rest

SLIGHTLY = 2e-5  # m
LOW = np.radians((30.0, -40.0, 95.0, -20.0, 0.0))
"""Posture with the fingers about 10 cm above the table."""


def clearance(world: CollisionWorld, state: State) -> float:
    contact = world.nearest(np.append(state.setpoint, state.gripper_setpoint))
    assert contact is not None
    return contact.distance


def run(
    session: Session, state: State, *commands: cmd.Command, ticks: int = 500
) -> tuple[State, list[float]]:
    """Return the last state when the arm rests, and the clearance after some ticks [m]."""
    passed = until_rest(session, state, *commands, ticks=ticks)
    world = session.world
    samples = [*passed[:: 1 if LONG else 3], passed[-1]]
    return passed[-1], [] if world is None else [clearance(world, after) for after in samples]


def standing(session: Session, q: FloatArray, gripper: float = 0.0) -> State:
    return session.begin(q, gripper, 0.0)


INTO: dict[str, tuple[FloatArray, list[cmd.Command], set[str]]] = {
    "table": (LOW, [cmd.Joint(2, 0.13)], {"table"}),
    "base": (
        np.radians((0.0, -120.0, 100.0, 0.0, 0.0)),
        [cmd.Joint(4, np.radians(107.0)), cmd.Joint(3, np.radians(127.0))],
        {"base_link", "arm_base_link", "pan_link", "upper_arm_link"},
    ),
    "cup": (LOW, [cmd.Joint(1, -0.6)], {"cup"}),
}


@cache
def approach(session: Session, what: str) -> list[State]:
    """Return the states after each tick of a motion of INTO, until the arm rests."""
    start, commands, _ = INTO[what]
    return until_rest(session, standing(session, start), *commands)


@pytest.mark.parametrize("what", INTO)
def test_arm_at_full_speed_stops_before_contact(
    guarded: Session, world: CollisionWorld, what: str
) -> None:
    names, passed = INTO[what][2], approach(guarded, what)
    state, near = passed[-1], [clearance(world, after) for after in passed]
    assert min(near) >= MIN_CLEARANCE - SLIGHTLY
    assert state.blocked
    assert state.status is Status.BLOCKED
    assert state.under_way
    finding = state.findings[0]
    assert finding.reason is Reason.CONTACT
    assert finding.parts is not None
    assert names & set(finding.parts)
    assert finding.amount == pytest.approx(near[-1], abs=1e-9)
    assert MIN_CLEARANCE - SLIGHTLY <= finding.amount < 2.0 * MIN_CLEARANCE


@pytest.mark.parametrize("what", INTO)
def test_arm_leaves_a_contact_at_full_speed(guarded: Session, what: str) -> None:
    start, blocked = INTO[what][0], approach(guarded, what)[-1]
    back = cmd.Joints(start)
    state, near = run(guarded, blocked, back)
    assert (state.setpoint == start).all()
    assert state.findings == ()
    free = rested(
        Session(guarded.require_arm(), guarded.ready), standing(guarded, blocked.setpoint), back
    )
    assert state.t - blocked.t <= free.t + 2.0 * TICK
    assert min(near) >= MIN_CLEARANCE - SLIGHTLY


def test_blocked_arm_stays_still_to_the_bit(guarded: Session) -> None:
    state = blocked = approach(guarded, "table")[-1]
    for _ in range(50):
        state = guarded.step(state, [], state.t + TICK)
        assert state.setpoint is blocked.setpoint
        assert state.findings == blocked.findings


def test_blocked_arm_continues_once_its_path_is_clear(
    guarded: Session, world: CollisionWorld
) -> None:
    blocked = approach(guarded, "cup")[-1]
    cup = len(world.parts) - 1
    pairs = [pair for pair in world.pairs if cup not in pair]
    without_cup = CollisionWorld(world.linkage, world.parts[:-1], pairs)
    freed = Session(guarded.require_arm(), guarded.ready, without_cup)
    state = rested(freed, blocked)
    assert (state.setpoint == state.goal).all()
    assert state.status is Status.OK


def test_end_of_a_drag_before_a_contact_drops_the_rest_of_the_path(guarded: Session) -> None:
    blocked = rested(guarded, standing(guarded, LOW), cmd.Position(np.array([0.40, 0.23, -0.35])))
    assert blocked.blocked
    let_go = guarded.step(blocked, [cmd.EndDrag()], blocked.t + TICK)
    assert (let_go.goal == blocked.setpoint).all()
    assert isinstance(let_go.target, JointTarget)
    assert not let_go.under_way
    assert let_go.findings[0].reason is Reason.CONTACT


def test_fingers_wait_before_a_cup_until_the_arm_moves_away(guarded: Session) -> None:
    """The closed tool is beside the cup; then the fingers open, and the arm moves."""
    start, commands, _ = INTO["cup"]
    blocked = rested(guarded, standing(guarded, start, gripper=-0.44), *commands)
    at_cup = guarded.step(blocked, [cmd.Hold()], blocked.t + TICK)
    state, near = run(guarded, at_cup, cmd.Gripper(0.30))
    assert state.blocked
    assert state.gripper_setpoint < 0.30
    assert min(near) >= MIN_CLEARANCE - SLIGHTLY
    assert "cup" in (state.findings[0].parts or ())
    state, near = run(guarded, state, cmd.Joint(1, 0.5))
    assert state.setpoint[0] == 0.5
    assert state.gripper_setpoint == 0.30
    assert min(near) >= MIN_CLEARANCE - SLIGHTLY


def test_arm_in_a_contact_may_only_leave_it(guarded: Session, world: CollisionWorld) -> None:
    """A contact can exist at the start if a cup is put where the arm already is."""
    inside = np.radians((-13.0, -40.0, 95.0, -20.0, 0.0))
    state = standing(guarded, inside)
    depth = clearance(world, state)
    assert depth < 0.0
    deeper, near = run(guarded, state, cmd.Joint(2, 0.0))
    assert deeper.blocked
    assert min(near) >= depth - SLIGHTLY
    state, near = run(guarded, deeper, cmd.Joint(2, np.radians(-70.0)))
    assert state.status is Status.OK
    assert near[-1] > MIN_CLEARANCE


def test_contact_of_a_branch_is_reported_before_the_change(guarded: Session) -> None:
    """Close to the base the other elbow has no room."""
    state = standing(guarded, np.radians((10.5, -75.6, 94.5, 88.4, 47.8)))
    options = {choice.branch: choice for choice in guarded.choices(state)}
    own = options[state.branch]
    assert own.contact is None
    blocked = [choice for choice in options.values() if choice.contact is not None]
    assert blocked
    for choice in blocked:
        assert choice.contact is not None
        assert choice.contact.distance < MIN_CLEARANCE
        changed, near = run(guarded, state, cmd.Branch(name=str(choice.branch)), ticks=2000)
        assert changed.status is Status.BLOCKED
        assert min(near) > 0.0


def test_braking_arm_with_a_new_target_keeps_its_finding(guarded: Session) -> None:
    """A slider sends many angles on its way; at first other parts are nearer."""
    state = standing(guarded, guarded.ready)
    named = set()
    for tick, angle in enumerate(np.radians(np.linspace(-60.0, 5.0, 150))):
        commands = [] if tick % 4 else [cmd.Joint(2, float(angle))]
        state = guarded.step(state, commands, state.t + TICK)
        named |= {f.parts for f in state.findings if f.reason is Reason.CONTACT}
    state = rested(guarded, state)
    (finding,) = (f for f in state.findings if f.reason is Reason.CONTACT)
    assert state.status is Status.BLOCKED
    assert finding.parts is not None
    assert all(parts is not None and "table" in parts for parts in named), named
    assert finding.amount == pytest.approx(clearance(guarded.world, state), abs=1e-3)  # type: ignore[arg-type]


class BrakeAside:
    """A brake that turns axis 1 aside by an angle [rad], and back."""

    def __init__(self, angle: float) -> None:
        self.turn = np.array((angle, 0.0, 0.0, 0.0, 0.0))

    def stopping_range(self, now: JointMotion) -> tuple[FloatArray, FloatArray]:
        return now.q - np.abs(self.turn), now.q + np.abs(self.turn)

    def stopping_path(self, now: JointMotion, *_: object) -> list[JointCurve]:
        there_and_back = JointCurve(
            lambda part: now.q + self.turn * (1.0 - abs(2.0 * part - 1.0)),
            lambda _low, _high: np.zeros(5),
        )
        return there_and_back.pieces(16)


def test_brake_that_comes_too_near_and_leaves_again_is_a_contact(guarded: Session) -> None:
    world = guarded.world
    assert world is not None
    x = np.append(LOW, 0.0)

    def distance(angle: float) -> float:
        contact = world.nearest(x + angle * np.eye(6)[0])
        assert contact is not None
        return contact.distance

    def met(angle: float) -> Contact | None:
        brake = BrakeAside(angle)
        return met_before_rest(world, brake, x, JointMotion.rest(LOW))  # type: ignore[arg-type]

    near = next(angle for angle in np.arange(0.0, -1.0, -5e-4) if distance(angle) < MIN_CLEARANCE)
    assert met(near + 0.01) is None
    contact = met(near - 0.001)
    assert contact is not None
    assert "cup" in contact.parts
