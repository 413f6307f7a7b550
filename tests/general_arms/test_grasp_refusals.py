"""Refusals of arms outside the five-axis family that cannot grasp or place an object."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.planning.hand_frames import Approach
from katana450.extensions.programs.planning.hand_planning import hand_of
from katana450.maths.geometry import so3
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.gripping_arms import HANDS, gripping_urdf
from tests.general_arms.published_hands import HOOK, RADIAL, VICE, hand_urdf, so101_urdf
from tests.general_arms.test_grasping import item, planned

PART = item("part", "box", (40.0, 50.0, 60.0), (500.0, 100.0))
WIDE = item("part", "box", (90.0, 95.0, 60.0), (500.0, 100.0))
THIN = item("part", "box", (40.0, 50.0, 8.0), (500.0, 100.0))
FIXED = item("part", "box", (40.0, 50.0, 60.0), (500.0, 100.0), can_be_held=False)
FAR = item("part", "box", (25.0, 25.0, 50.0), (600.0, 0.0))
FLAT = item("part", "box", (25.0, 25.0, 15.0), (280.0, 0.0))
SKEW = item("part", "box", (25.0, 25.0, 50.0), (200.0, 0.0), 40.0)
STRAIGHT = item("part", "box", (25.0, 20.0, 50.0), (200.0, 0.0))


@pytest.mark.cases(3)
@pytest.mark.parametrize(
    ("steps", "thing", "why"),
    [
        (["pick: part"], WIDE, r"90 mm wide, .* fingers are 85 mm apart .* may have 73 mm"),
        (["pick: part"], THIN, "8.0 mm high, and the minimum is 12 mm"),
        (["pick: part"], FIXED, "cannot be held by the fingers"),
        (["set_down:"], PART, "holds no object that this program grasped"),
    ],
)
def test_six_axes_give_the_reason(steps: list[str], thing: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(ScriptError, match=why):
        planned(tmp_path, gripping_urdf("UR5e"), steps, thing)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("steps", "thing", "why"),
    [
        (["pick: part"], FAR, r"cannot be grasped at its place: .* mm out of reach"),
        (["pick: part", "place: {at: {x: 600, y: 0}}"], STRAIGHT, "cannot be placed .* reach"),
        (["grasp: {object: part, pitch: 5}"], FLAT, "at its place: .* and table would"),
        (["pick: part"], SKEW, "turned too far, .* four axes cannot turn the hand"),
        (
            ["pick: part", "place: {at: {x: 160, y: -100, yaw: 20}}"],
            STRAIGHT,
            r"yaw would be -3\d\.\d deg there instead of 20. Leave out the yaw",
        ),
    ],
)
def test_four_axes_give_the_reason(steps: list[str], thing: str, why: str, tmp_path: Path) -> None:
    with pytest.raises(ScriptError, match=why):
        planned(tmp_path, gripping_urdf("OpenMANIPULATOR-X"), steps, thing)


def test_room_of_both_jaws_is_stated(tmp_path: Path) -> None:
    wide = item("part", "box", (150.0, 150.0, 50.0), (260.0, 0.0))
    why = r"150 mm wide, .* need 6 mm of room beside the moving jaw and 7 mm beside the fixed one"
    with pytest.raises(ScriptError, match=why) as refused:
        planned(tmp_path, so101_urdf(), ["pick: part"], wide)
    numbers = re.search(r"are (\d+) mm apart .* may have (\d+) mm", str(refused.value))
    assert numbers is not None
    assert int(numbers[1]) - int(numbers[2]) == 6 + 7


def without_bodies(text: str) -> str:
    """Return the description without collision shapes of its fingers."""
    for finger in ("left", "right"):
        start = text.index(f'<link name="{finger}">')
        end = text.index("</link>", start)
        link = text[start:end]
        text = text.replace(link, link[: link.index("<collision>")])
    return text


UR5E = gripping_urdf("UR5e")
HANDS_THAT_CANNOT = {
    "no gripper": (chain_urdf("arm", HANDS["UR5e"][0]), "has no gripper"),
    "no bodies": (without_bodies(UR5E), "contacts of the fingers cannot be computed"),
    "three directions": (
        hand_urdf("UR5e", RADIAL),
        "moves digit_3 across the direction in which digit_1 and digit_2 close",
    ),
    "nothing opposite": (
        hand_urdf("UR5e", HOOK),
        "moves hook, which closes neither on another finger nor on a body of the palm",
    ),
    "no tip": (
        hand_urdf("UR5e", VICE),
        "middle of cheek is on a line along its motion through the middle of the palm",
    ),
    "five axes": (
        chain_urdf("arm", HANDS["UR5e"][0]).replace("revolute", "fixed", 1),
        "5 axes outside the five-axis family cannot keep an object upright",
    ),
}


@pytest.mark.parametrize("name", HANDS_THAT_CANNOT)
def test_hand_that_cannot_grasp_is_named(name: str, tmp_path: Path) -> None:
    urdf, why = HANDS_THAT_CANNOT[name]
    with pytest.raises(ScriptError, match=why):
        planned(tmp_path, urdf, ["pick: part"], PART)


def test_fixed_jaw_on_the_other_side_is_not_out_of_reach(tmp_path: Path) -> None:
    """A hand that is mounted half a turn farther reaches its jaw's other side by a turn back."""
    plan = planned(tmp_path, so101_urdf(), ["gripper: open"], PART)
    session = plan.session
    hand = hand_of(session, plan.robot.require_arm().T_base_shoulder, plan.start)
    assert hand.plane is not None
    middle = np.array((0.23, 0.06, 0.03))
    target = hand.before(middle, Approach(0.5), 0.01)
    turned = so3.rotation_x(math.pi) @ hand.plane.R_hand_tool
    farther = replace(hand, plane=replace(hand.plane, R_hand_tool=turned))
    other = farther.before(middle, Approach(0.5, math.pi), 0.01)
    assert math.remainder(other.roll - target.roll, math.tau) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(other.position, target.position, atol=1e-12)
    assert farther.branches_to(session.ready, other)
