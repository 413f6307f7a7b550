"""The forces of the fingers, the preload that they follow from, and the object that slips."""

from __future__ import annotations

import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Hand
from katana450.arm.control.objects.grip import FINGER_FORCE, contacts_of, finger_forces
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.event_log import entries_between
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.restart import restarted
from katana450.arm.control.state.state import Reason, State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.water.units import GRAVITY
from katana450.server.api import answers
from katana450.server.service import serialize
from tests.control.test_grip import OPEN, lifted
from tests.ticks import during, rested, settled, ticked

WEIGHT = 0.0614 * GRAVITY
"""[N] Weight of the empty cup."""

SIDES = ["finger_right_link", "finger_left_link"]


@pytest.fixture(scope="module")
def hand(session: Session) -> Hand:
    hand = session.environment.hand
    assert hand is not None
    return hand


def with_preload(session: Session, holding: State, preload: float) -> State:
    """Return the state a while after a command that closes ``preload`` [rad] beyond the cup."""
    assert holding.grip is not None
    return ticked(session, rested(session, holding, cmd.Gripper(holding.grip - preload)), ticks=30)


def test_command_beyond_the_object_is_its_preload(session: Session, holding: State) -> None:
    assert holding.grip is not None
    assert holding.squeeze == holding.grip + 0.44
    softer = rested(session, holding, cmd.Gripper(holding.grip - 0.05))
    assert softer.squeeze == pytest.approx(0.05)
    assert softer.gripper_goal == softer.gripper_setpoint == holding.grip
    assert softer.findings == ()
    beyond = rested(session, holding, cmd.Gripper(-1.0))
    assert beyond.squeeze == holding.squeeze
    assert [finding.reason for finding in beyond.findings] == [Reason.GRIPPER_LIMIT]


def test_stop_and_restart_keep_the_preload_and_opening_clears_it(
    session: Session, hand: Hand, holding: State
) -> None:
    stopped = rested(session, holding, cmd.Stop())
    assert stopped.held is not None
    assert stopped.squeeze == holding.squeeze
    start = session.begin(holding.q, holding.gripper, 0.0)
    assert restarted(start, holding).squeeze == holding.squeeze
    opened = rested(session, holding, cmd.Gripper(OPEN))
    assert (opened.squeeze, opened.grip) == (0.0, None)
    assert set(finger_forces(hand, opened).values()) == {0.0}


def test_both_fingers_press_alike_and_harder_with_more_preload(
    session: Session, hand: Hand, holding: State
) -> None:
    forces = []
    for preload in (0.02, 0.05, 0.09, 0.3):
        by_finger = finger_forces(hand, with_preload(session, holding, preload))
        assert list(by_finger) == SIDES
        right, left = by_finger.values()
        assert right == pytest.approx(left, rel=0.1)
        forces.append(right)
    # The last preload is more than the drive gives way to.
    assert forces == sorted(forces)
    assert forces[-1] <= FINGER_FORCE
    tight = finger_forces(hand, holding)
    assert forces[-1] == pytest.approx(tight[SIDES[0]], rel=0.1)


def test_friction_of_the_fingers_carries_the_lifted_cup(
    session: Session, arm: MountedArm, holding: State
) -> None:
    up = ticked(session, lifted(session, arm, holding, 0.03), ticks=50)
    contacts = contacts_of(up)
    assert sum(contact.friction for contact in contacts) >= 0.99 * WEIGHT
    assert all(contact.friction <= 0.81 * contact.force for contact in contacts)


def test_answer_names_each_finger_with_its_force(hand: Hand, around: State, holding: State) -> None:
    free, tight = serialize.touch(hand, around), serialize.touch(hand, holding)
    assert [finger.finger for finger in free.fingers] == SIDES
    assert [finger.force for finger in free.fingers] == [0.0, 0.0]
    assert (free.preload, free.force_limit) == (0.0, FINGER_FORCE)
    assert tight.preload == holding.squeeze
    assert {finger.finger: finger.force for finger in tight.fingers} == finger_forces(hand, holding)
    assert min(finger.force for finger in tight.fingers) > 1.0


def test_cup_falls_from_a_weak_grip_with_a_reason(
    session: Session, arm: MountedArm, hand: Hand, holding: State
) -> None:
    high = lifted(session, arm, holding, 0.03)
    assert high.grip is not None
    passed = during(session, high, 2.0, cmd.Gripper(high.grip - 0.002))
    lost = next(state for state in passed if state.held is None)
    assert (lost.held, lost.grip, lost.squeeze) == (None, None, 0.0)
    (slipped,) = (finding for finding in lost.findings if finding.reason is Reason.SLIPPED)
    assert slipped.parts is not None
    assert slipped.parts[0] == "cup"
    assert 0.0 < slipped.amount < 2.0 * WEIGHT
    assert "cup slipped out of the fingers under a load of" in sentence(lost).lower()
    assert any(entry.began and entry.finding is slipped for entry in entries_between(high, lost))
    finding = serialize.finding(slipped)
    assert isinstance(finding, answers.Finding)
    assert (finding.reason, finding.unit, finding.amount) == ("slipped", "N", slipped.amount)
    rest = settled(session, passed[-1])
    (cup,) = (scene_object for scene_object in rest.objects if scene_object.name == "cup")
    assert abs(cup.T[2, 3]) < 1e-3
    assert max(finger_forces(hand, rest).values()) < 1.0
    opened = rested(session, rest, cmd.Gripper(OPEN))
    assert Reason.SLIPPED not in {finding.reason for finding in opened.findings}
