"""The forces of the fingers, the preload that they follow from, and the object that slips."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Hand
from katana450.arm.control.objects.grip import FINGER_FORCE, contacts_of, finger_forces
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import restarted
from katana450.arm.control.state.findings import entries_between
from katana450.arm.control.state.messages import sentence
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import Reason, State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.run.simulation import follow_exactly, run_by_clock, simulated
from katana450.extensions.programs.script.script import parse
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import verify_recording
from katana450.maths.water.units import GRAVITY
from katana450.server.api import answers
from katana450.server.service import serialize
from tests.control.test_grip import OPEN, lifted
from tests.general_arms.test_grasping import item, planned
from tests.general_arms.test_published_hands import KINDS
from tests.recording.recorded import fresh
from tests.recording.sessions import record_session
from tests.ticks import TICK, during, rested, settled, ticked

WEIGHT = 0.0614 * GRAVITY
"""[N] Weight of the empty cup."""

SIDES = ["finger_right_link", "finger_left_link"]


@pytest.fixture(scope="module")
def hand(session: Session) -> Hand:
    hand = session.environment.hand
    assert hand is not None
    return hand


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
    assert holding.grip is not None
    forces = []
    for preload in (0.02, 0.05, 0.09, 0.3):
        closed = rested(session, holding, cmd.Gripper(holding.grip - preload))
        by_finger = finger_forces(hand, ticked(session, closed, ticks=30))
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


@pytest.mark.long
@pytest.mark.parametrize("name", ["SO-101", "Robotiq 2F-85"])
def test_both_sides_of_another_hand_press_on_a_box(name: str, tmp_path: Path) -> None:
    kind = KINDS[name]
    box = item("part", "box", kind.box, kind.at, 17.0)
    plan = planned(tmp_path, kind.urdf, ["pick: part"], box)
    state = run_by_clock(plan).states[-1]
    hand = plan.session.environment.hand
    assert hand is not None
    assert state.held is not None
    forces = {finger.finger: finger.force for finger in serialize.touch(hand, state).fingers}
    sides = hand.gripping_sides
    assert list(forces) == [part for side in sides for part in side]
    one, other = (sum(forces[part] for part in side) for side in sides)
    # Where the faces of the jaws are not parallel, friction balances the rest.
    assert one == pytest.approx(other, rel=0.25)
    assert 1.0 < one < 1.1 * FINGER_FORCE


ROD = SceneObject(
    "rod",
    Shape.CYLINDER,
    (0.015, 0.31),
    np.array(((1, 0, 0, 0.4477), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1.0))),
    can_be_held=True,
)
"""A rod on the table between the open fingers in the ready posture."""


def test_grip_and_slip_are_identical_to_the_bit_in_a_recording(tmp_path: Path) -> None:
    states: list[State] = []

    def commands(tick: int, state: State) -> Iterator[cmd.Command]:
        states.append(state)
        if tick == 0:
            yield cmd.Gripper(OPEN)
        elif tick == 60:
            yield cmd.PlaceObject(ROD)
            yield cmd.Gripper(-0.44)
        elif tick == 160:
            assert state.grip is not None
            # So little force that the moving hand loses the rod.
            yield cmd.Gripper(state.grip - 0.01)
        elif tick == 170:
            yield cmd.Joint(2, state.q[1] - 0.1)

    path = record_session(tmp_path / "slip.mcap", 250, commands)
    assert max(state.squeeze for state in states[:160]) > 0.05
    assert states[165].squeeze == pytest.approx(0.01)
    reasons = {finding.reason for state in states for finding in state.findings}
    assert Reason.SLIPPED in reasons
    forces = {contact.force for state in states for contact in contacts_of(state)}
    assert len(forces) > 20, "they change while the rod slips"
    with RecordingFile.open(path) as file:
        result = verify_recording(file, fresh().session)
    assert result.identical, result
    assert result.ticks > 150


def test_fingers_crush_what_bears_less_than_their_force(
    session: Session, arm: MountedArm, around: State
) -> None:
    (cup,) = (item for item in around.objects if item.name == "cup")

    def closed_on(crush_force: float) -> State:
        firm = replace(around, objects=(replace(cup, crush_force=crush_force),))
        return rested(session, firm, cmd.Gripper(-0.44))

    crushed, whole = closed_on(3.0), closed_on(2.0 * FINGER_FORCE)
    assert whole.held is not None
    assert Reason.CRUSHED not in {finding.reason for finding in whole.findings}
    (finding,) = (f for f in crushed.findings if f.reason is Reason.CRUSHED)
    assert 3.0 < finding.amount <= FINGER_FORCE
    assert finding.limit == 3.0
    assert "cup was crushed: " in sentence(crushed).lower()
    assert "and it bears 3.0 n" in sentence(crushed).lower()
    # The next command of the fingers ends it.
    opened = rested(session, crushed, cmd.Gripper(OPEN))
    assert Reason.CRUSHED not in {finding.reason for finding in opened.findings}
    # A program that closes them stops with the reason.
    firm = replace(around, objects=(replace(cup, crush_force=3.0),))
    program = compiled(
        parse("steps: [{gripper: -25}]"), PlanContext(session, arm.T_base_shoulder), firm
    )
    (*_, (_, run)) = simulated(program, session, firm, TICK, follow_exactly)
    assert run.phase is Phase.FAILED
    assert "was crushed" in run.why


@pytest.mark.parametrize("force", [0.0, -1.0, float("nan"), 1e9])
def test_impossible_crush_force_is_refused(around: State, force: float) -> None:
    with pytest.raises(InputError, match="force that 'cup' bears"):
        replace(around.objects[0], crush_force=force)
