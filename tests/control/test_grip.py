"""The cup in the hand: the fingers touch it, hold it, carry it, and put it down."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.grip import touching
from katana450.arm.control.session.plans import plan_along, plan_to
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import MAX_OBJECTS, SceneObject, Shape
from katana450.arm.control.state.state import Reason, State
from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.collision import scene_objects_of
from katana450.arm.robot.props import load_props
from katana450.errors import InputError
from katana450.extensions.programs.planning.curve_path import ToolPath
from katana450.extensions.programs.planning.curves import ToolLine
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.solver import inverse
from katana450.maths.kinematics.tool import ToolTarget
from tests.ticks import rested, settled

OPEN = 0.3
PITCH = np.deg2rad(40.0)
HEIGHT = 0.07
"""[m] Height above the table at which the cup is grasped."""

BEFORE, AT = 0.08, 0.016
"""[m] Distances from the cup's axis at which the open fingers approach, and at which they close. If
the grasp frame came nearer, the tilted palm would be in the cup."""


@pytest.fixture(scope="module")
def session(shipped: Session) -> Session:
    return shipped


def cup_of(session: Session, state: State) -> tuple[SceneObject, FloatArray]:
    (cup,) = (scene_object for scene_object in state.objects if scene_object.name == "cup")
    return cup, session.environment.pose(cup, np.append(state.q, state.gripper))


def before_cup(
    session: Session, arm: MountedArm, state: State, back: float, offset: float = 0.0
) -> FloatArray:
    """Return the joints (5,) with the grasp frame ``back`` [m] before the cup's axis.

    The distance is along the tool. beside: distance to the left of the axis [m].
    """
    chain = arm.chain_to("grasp")
    _, T = cup_of(session, state)
    p = T[:3, 3] - arm.T_base_shoulder[:3, 3] + [0.0, 0.0, HEIGHT]
    azimuth = np.arctan2(p[1], p[0])
    out = np.array((np.cos(azimuth), np.sin(azimuth), 0.0))
    p = p - back * (np.cos(PITCH) * out - np.sin(PITCH) * np.array((0.0, 0.0, 1.0)))
    p = p + offset * np.array((-out[1], out[0], 0.0))
    azimuth = np.arctan2(p[1], p[0])
    pose = ToolTarget(p, PITCH, 0.0).pose(chain, azimuth)
    (best,) = (
        solution.q
        for solution in inverse(chain, pose)
        if solution.within_limits and str(solution.branch) == "front-up"
    )
    return best


@cache
def around_cup(session: Session, arm: MountedArm, offset: float = 0.0) -> State:
    """Return the state with the open fingers round the cup, ``offset`` [m] off its middle."""
    state = session.begin(session.ready, 0.0, 0.0)
    state = rested(session, state, cmd.Gripper(OPEN), cmd.Tool("grasp"))
    for back in (BEFORE, AT):
        q = before_cup(session, arm, state, back, offset)
        plan = plan_to(arm, session.world_at(state), state, q)
        state = rested(session, state, cmd.Follow(plan))
    return state


@pytest.fixture(scope="module")
def holding(session: Session, arm: MountedArm) -> State:
    """The state with the cup between the fingers, on the table."""
    state = around_cup(session, arm)
    return rested(session, state, cmd.Gripper(-0.44))


def test_closed_fingers_hold_the_cup_in_place(session: Session, holding: State) -> None:
    cup, T = cup_of(session, holding)
    assert cup.held
    assert holding.grip == holding.gripper_setpoint
    let_go = session.environment.world([replace(cup, held=False, T=T)])
    assert let_go is not None
    x = np.append(holding.q, holding.gripper)
    for finger in ("finger_left_link", "finger_right_link"):
        assert -7e-4 <= let_go.gap(x, finger, "cup") <= 0.003
    (stood,) = (
        scene_object.T
        for scene_object in scene_objects_of(load_props())
        if scene_object.name == "cup"
    )
    # Two fingers that close at the same time push it aside by micrometres.
    np.testing.assert_allclose(T, stood, rtol=0, atol=1e-3)
    assert holding.status.value == "ok"


@cache
def lifted(session: Session, arm: MountedArm, state: State, by: float) -> State:
    """Return the state with the tool ``by`` [m] higher, with the same pitch and roll."""
    chain = arm.chain_to("grasp")
    target = ToolTarget.at(chain, state.q)
    up = replace(target, position=target.position + np.array((0.0, 0.0, by)))
    way = ToolPath(chain, ToolLine(target, up), state.branch, state.q)  # type: ignore[arg-type]
    return rested(
        session, state, cmd.Follow(plan_along(arm, session.world_at(state), state, [way]))
    )


def test_held_object_moves_with_the_hand_and_is_checked_for_contacts(
    session: Session, arm: MountedArm, holding: State
) -> None:
    up = lifted(session, arm, holding, 0.06)
    _, T = cup_of(session, holding)
    _, T_up = cup_of(session, up)
    # Friction holds it, so it may slip by some hundredths of a millimetre.
    np.testing.assert_allclose(T_up[:3, :3], T[:3, :3], rtol=0, atol=1e-3)
    np.testing.assert_allclose(T_up[:3, 3] - T[:3, 3], (0.0, 0.0, 0.06), rtol=0, atol=1e-4)
    # A move down by more than the free height: the cup meets the table, not the fingers.
    chain = arm.chain_to("grasp")
    target = ToolTarget.at(chain, up.q)
    down = rested(session, up, cmd.Position(target.position - [0.0, 0.0, 0.1]))
    (contact,) = (f for f in down.findings if f.reason is Reason.CONTACT)
    assert contact.parts is not None
    assert set(contact.parts) == {"cup", "table"}
    assert 0.005 <= contact.amount < 0.01
    cup, T = cup_of(session, down)
    # The path down has tilted the cup a little, so an edge of its foot is lowest.
    lowest = T[2, 3] - cup.size[0] * np.sqrt(1.0 - T[2, 2] ** 2)
    assert contact.amount == pytest.approx(lowest, abs=1e-4)


def test_holding_hand_closes_no_further_and_keeps_the_cup_in_a_stop(
    session: Session, holding: State
) -> None:
    tight = rested(session, holding, cmd.Gripper(-0.44))
    assert tight.gripper == holding.grip
    hand = session.environment.hand
    assert hand is not None
    assert touching(hand, tight) == hand.fingers
    stopped = rested(session, session.step(tight, [cmd.Joint(1, 0.3)], tight.t + 0.01), cmd.Stop())
    cup, _ = cup_of(session, stopped)
    assert cup.held
    assert stopped.stopped is not None


def test_opened_fingers_leave_the_cup_on_the_table(
    session: Session, arm: MountedArm, holding: State
) -> None:
    up = lifted(session, arm, holding, 0.005)
    _, T_up = cup_of(session, up)
    left = settled(session, rested(session, up, cmd.Gripper(OPEN)))
    cup, T = cup_of(session, left)
    assert not cup.held
    assert left.grip is None
    # A finger that still touches it while it falls takes it along a bit.
    np.testing.assert_allclose(T[:2, 3], T_up[:2, 3], rtol=0, atol=2e-3)
    assert abs(T[2, 3]) < 2e-5
    np.testing.assert_allclose(T[2, :3], (0.0, 0.0, 1.0), rtol=0, atol=2e-3)
    # The arm may move away from an object between its open fingers.
    back = before_cup(session, arm, left, BEFORE)
    away = rested(session, left, cmd.Joints(back))
    np.testing.assert_allclose(away.q, back, rtol=0, atol=1e-9)


def test_first_finger_pushes_the_cup_to_the_second(session: Session, arm: MountedArm) -> None:
    before = around_cup(session, arm, 0.008)
    held = rested(session, before, cmd.Gripper(-0.44))
    assert cup_of(session, held)[0].held
    pushed = cup_of(session, held)[1][:3, 3] - cup_of(session, before)[1][:3, 3]
    assert np.linalg.norm(pushed) == pytest.approx(0.008, abs=1e-3)


def test_one_finger_stops_at_what_it_cannot_push_and_is_reported(
    session: Session, arm: MountedArm
) -> None:
    state = around_cup(session, arm, 0.008)
    # In place of the cup a board of 5.6 kg, whose friction on the table is 19 N.
    T = cup_of(session, state)[1]
    R = so3.rotation_z(float(np.arctan2(T[1, 3], T[0, 3])))
    T = se3.from_rotation_translation(R, T[:3, 3] + R @ (0.33, 0.0, 0.0))
    board = scene_object("board", size=(0.7, 0.04, 0.4), T=T, can_be_held=True)
    closed = rested(session, state, cmd.Remove("cup"), cmd.PlaceObject(board), cmd.Gripper(-0.44))
    assert closed.held is None
    (lopsided,) = (f for f in closed.findings if f.reason is Reason.LOPSIDED)
    assert lopsided.parts is not None
    assert lopsided.parts[1] == "board"
    assert lopsided.amount > 0.003
    hand = session.environment.hand
    assert hand is not None
    assert {*touching(hand, closed), lopsided.parts[0]} == set(hand.fingers)
    np.testing.assert_allclose(closed.objects[-1].T, T, rtol=0, atol=1e-3)
    opened = rested(session, closed, cmd.Gripper(OPEN))
    assert not any(f.reason is Reason.LOPSIDED for f in opened.findings)
    assert touching(hand, opened) == ()


def scene_object(name: str = "box", **changed: Any) -> SceneObject:
    fields: dict[str, Any] = {
        "name": name, "shape": Shape.BOX, "size": (0.05, 0.05, 0.05),
        "T": se3.from_rotation_translation(np.eye(3), (0.4, 0.0, 0.0)),
    }  # fmt: skip
    return SceneObject(**(fields | changed))


def test_objects_are_replaced_by_name_and_limited_in_number(session: Session, state: State) -> None:
    commands: list[cmd.Command] = [
        cmd.PlaceObject(scene_object(f"box {n}")) for n in range(2 * MAX_OBJECTS)
    ]
    state = session.step(state, commands, 0.01)
    assert len(state.objects) == MAX_OBJECTS
    moved = se3.from_rotation_translation(np.eye(3), (-0.1, 0.4, 0.0))
    state = session.step(state, [cmd.PlaceObject(scene_object("cup", T=moved))], 0.02)
    assert len(state.objects) == MAX_OBJECTS
    np.testing.assert_allclose(cup_of(session, state)[1], moved, rtol=0, atol=2e-5)


def test_held_object_cannot_be_moved_or_removed(session: Session, holding: State) -> None:
    state = session.step(
        holding,
        [cmd.PlaceObject(scene_object("cup")), cmd.Remove("cup"), cmd.Remove("basin")],
        holding.t + 0.01,
    )
    assert [prop.name for prop in state.objects] == ["cup"]
    assert cup_of(session, state)[0].held


@pytest.mark.parametrize(
    "wrong",
    [
        {"name": ""},
        {"name": "x" * 99},
        {"name": "a\nb"},
        {"size": (0.1, 0.1)},
        {"size": (0.1, 0.1, np.nan)},
        {"size": (0.1, 0.1, 0.0)},
        {"size": (0.1, 0.1, 99.0)},
        {"T": np.zeros((4, 4))},
        {"T": se3.from_rotation_translation(np.eye(3), (0.0, 9.0, 0.0))},
        {"T": np.full((4, 4), np.nan)},
    ],
)
def test_invalid_object_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        scene_object(**wrong)
