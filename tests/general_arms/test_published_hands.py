"""Hands of all kinds pick and place: closing upwards, linkages of bars, one jaw."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from katana450.arm.control.state.state import State
from katana450.extensions.programs.run.simulation import Planned
from tests.general_arms.gripping_arms import gripping_urdf
from tests.general_arms.published_hands import (
    ROBOTIQ_2F_85,
    XARM_GRIPPER,
    hand_urdf,
    px150_urdf,
    so101_urdf,
)
from tests.general_arms.test_grasping import in_base, item, planned, played
from tests.programs.test_pick_place import place

TOUCH = 1e-3
"""[m] Maximum gap between an object and the sides that hold it."""


def with_one_finger(text: str) -> str:
    """Return the description with the right finger fixed to the palm."""
    start = text.index('<joint name="finger_right"')
    joint = text[start : text.index("</joint>", start)]
    return text.replace(joint, joint.replace('"prismatic"', '"fixed"').split("<axis")[0])


def with_three_fingers(text: str) -> str:
    """Return the description with another finger, which moves as the right one does."""
    start = text.index('<link name="right">')
    finger = text[start : text.index("</joint>", text.index('<joint name="finger_right"')) + 8]
    third = finger.replace('"right"', '"third"').replace("finger_right", "finger_third")
    return text.replace("</robot>", third + "</robot>")


class Kind(NamedTuple):
    """A hand on an arm, and what it does.

    Attributes:
        urdf: the description.
        at, to: places of a box on the table [mm].
        box: its size [mm].
        ends: the closed and the open end of the finger joint [rad or m].
        sides: the fingers on each side, the tips first.
        jaw: the part with the fixed jaw; "" if both sides move.
    """

    urdf: str
    at: tuple[float, float]
    to: tuple[float, float]
    box: tuple[float, float, float]
    ends: tuple[float, float]
    sides: tuple[tuple[str, ...], ...]
    jaw: str = ""


UR5E = gripping_urdf("UR5e")
NEAR, AWAY, BOX = (500.0, 100.0), (400.0, -200.0), (40.0, 50.0, 60.0)
ROBOTIQ = tuple(
    tuple(f"{side}_{part}" for part in ("inner_finger", "inner_finger_pad"))
    + tuple(f"{side}_{part}" for part in ("inner_knuckle", "outer_finger"))
    for side in ("left", "right")
)
XARM = tuple(
    tuple(f"{side}_{part}" for part in ("finger", "outer_knuckle", "inner_knuckle"))
    for side in ("left", "right")
)
FINGERS = (("left",), ("right",))
KINDS = {
    "Robotiq 2F-85": Kind(
        *(hand_urdf("UR5e", ROBOTIQ_2F_85), NEAR, AWAY, BOX, (0.8, 0.0), ROBOTIQ)
    ),
    "xArm gripper": Kind(hand_urdf("UR5e", XARM_GRIPPER), NEAR, AWAY, BOX, (0.85, 0.0), XARM),
    "Robotiq on a Panda": Kind(
        *(hand_urdf("Panda", ROBOTIQ_2F_85), NEAR, AWAY, BOX, (0.8, 0.0), ROBOTIQ)
    ),
    "three links": Kind(
        *(with_three_fingers(UR5E), NEAR, AWAY, BOX, (0.0, 0.0425), (("left",), ("right", "third")))
    ),
    "one sliding jaw": Kind(
        *(with_one_finger(UR5E), NEAR, AWAY, (20.0, 20.0, 60.0), (0.0, 0.0425), (("left",),)),
        jaw="right",
    ),
    "PincherX-150": Kind(
        # Wider than its fingers close, which could not press on it otherwise.
        *(px150_urdf(), (230.0, 60.0), (180.0, -120.0), (28.0, 30.0, 50.0)),
        *((0.015, 0.037), FINGERS),
    ),
    "SO-101": Kind(
        *(so101_urdf(), (230.0, 60.0), (180.0, -120.0), (25.0, 20.0, 50.0)),
        *((-0.174533, 1.74533), (("moving_jaw_so101_v1_link",),), "gripper_link"),
    ),
}


def gaps(plan: Planned, before: State, held: State, jaw: str) -> list[float]:
    """Return the gap [m] between the object and each side at ``held``, before it was taken.

    jaw: the part with the fixed jaw; "" if both sides move.
    """
    world, hand = plan.session.world_at(before), plan.session.environment.hand
    assert world is not None
    assert hand is not None
    assert jaw in hand.fixed_jaw or not (jaw or hand.fixed_jaw)
    return [world.gap(held.x_setpoint, "part", *side) for side in hand.gripping_sides]


@pytest.mark.long
@pytest.mark.parametrize("name", KINDS)
def test_box_is_picked_and_placed(name: str, tmp_path: Path) -> None:
    kind = KINDS[name]
    box = item("part", "box", kind.box, kind.at, 17.0)
    to = "place: {{at: {{x: {}, y: {}}}}}".format(*kind.to)
    plan = planned(tmp_path, kind.urdf, ["pick: part", to, "home"], box)
    hand, gripper = plan.session.environment.hand, plan.session.require_arm().gripper
    assert hand is not None
    assert (gripper.closed, gripper.opened) == pytest.approx(kind.ends)
    assert hand.gripper == gripper == plan.robot.require_arm().gripper
    assert hand.sides == kind.sides
    states = played(plan)
    # It slips in the hand by some hundredths of a millimetre, and falls from 5 mm.
    assert place(states[-1].objects[0]) == pytest.approx([*kind.to, 0.0], abs=2.0)
    carried = [state for state in states if state.held is not None]
    first = states.index(carried[0])
    distances = gaps(plan, states[first - 1], carried[0], kind.jaw)
    assert len(distances) == 2
    assert max(distances) < TOUCH
    lifted = [in_base(plan, state) for state in carried]
    assert max(T[2, 3] for T in lifted) > 0.05
    # A jaw that turns tilts what it pushes by some degrees.
    assert min(T[2, 2] for T in lifted) > (0.98 if kind.jaw else 1.0 - 1e-5)
    moved = np.linalg.norm(states[first - 1].objects[0].T[:2, 3] - 1e-3 * np.array(kind.at))
    # The moving jaw pushes the box to the fixed one; two fingers leave it in its place.
    assert moved == pytest.approx(0.007 if kind.jaw else 0.0, abs=3e-3)
