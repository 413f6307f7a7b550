"""URDF files of arms with hands of published dimensions, whose bodies are plain boxes.

Joints, axes and ranges are those that the makers publish. The boxes are as large as the parts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from katana450.resources import INCLUDED
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.gripping_arms import HANDS, STAND
from tests.robot.public_arms import PX150, J, Triple, X, urdf

ZERO: Triple = (0.0, 0.0, 0.0)


class Box(NamedTuple):
    """A box of a link: its size and middle [m], and its turn about x, y and z [rad]."""

    link: str
    size: Triple
    at: Triple = ZERO
    rpy: Triple = ZERO


BAR = math.atan2(0.0376, 0.0429)
"""[rad] Lean of the bars of the open 2F-85 to its sides."""


def _robotiq_side(side: str, sign: float) -> list[J | Box]:
    """Return one finger of a 2F-85, on the positive side of y for ``sign`` 1."""
    lead = side == "left"
    turn = (0.0, 0.0, 0.0 if sign > 0.0 else math.pi)
    base = "robotiq_arg2f_base_link"
    knuckle, outer, inner, pad, bar = (
        f"{side}_{name}"
        for name in (
            *("outer_knuckle", "outer_finger", "inner_finger", "inner_finger_pad"),
            "inner_knuckle",
        )
    )
    return [
        J(
            *("finger_joint" if lead else f"{knuckle}_joint", "revolute", base, knuckle),
            *((0.0, 0.0306011 * sign, 0.054904), turn, X),
            limits=(0.0, 0.8),
            mimic=None if lead else ("finger_joint", 1.0),
            speed=2.0,
        ),
        J(f"{outer}_joint", "fixed", knuckle, outer, (0.0, 0.0315, -0.0041)),
        J(
            *(f"{inner}_joint", "revolute", outer, inner, (0.0, 0.0061, 0.0471), ZERO, X),
            limits=(-0.8757, 0.0),
            mimic=("finger_joint", -1.0),
            speed=2.0,
        ),
        J(f"{pad}_joint", "fixed", inner, pad, (0.0, -0.0220203, 0.03242)),
        J(
            *(f"{bar}_joint", "revolute", base, bar, (0.0, 0.0127 * sign, 0.06142), turn, X),
            limits=(0.0, 0.8757),
            mimic=("finger_joint", 1.0),
            speed=2.0,
        ),
        Box(outer, (0.022, 0.012, 0.045), (0.0, 0.004, 0.024)),
        Box(inner, (0.022, 0.014, 0.045), (0.0, -0.0115, 0.03)),
        Box(pad, (0.022, 0.00635, 0.0375)),
        Box(bar, (0.02, 0.008, 0.045), (0.0, 0.0188, 0.0215), (-BAR, 0.0, 0.0)),
    ]


ROBOTIQ_2F_85: list[J | Box] = [
    J("mount", "fixed", "tool0", "robotiq_arg2f_base_link"),
    Box("robotiq_arg2f_base_link", (0.063, 0.075, 0.06), (0.0, 0.0, 0.03)),
    *_robotiq_side("left", -1.0),
    *_robotiq_side("right", 1.0),
    J("tip", "fixed", "robotiq_arg2f_base_link", "tcp", (0.0, 0.0, 0.1493)),
]


def _xarm_side(side: str, sign: float) -> list[J | Box]:
    """Return one finger of an xArm gripper, on the positive side of y for ``sign`` 1."""
    lead, base = side == "left", "xarm_gripper_base_link"
    closing, back = (sign, 0.0, 0.0), (-sign, 0.0, 0.0)
    knuckle, finger, bar = (
        f"{side}_{name}" for name in ("outer_knuckle", "finger", "inner_knuckle")
    )
    mimic, lean = ("drive_joint", 1.0), math.atan2(0.0355, 0.042)
    return [
        J(
            *("drive_joint" if lead else f"{knuckle}_joint", "revolute", base, knuckle),
            *((0.0, 0.035 * sign, 0.059098), ZERO, closing),
            limits=(0.0, 0.85),
            mimic=None if lead else mimic,
            speed=2.0,
        ),
        J(
            *(f"{finger}_joint", "revolute", knuckle, finger, (0.0, 0.035465 * sign, 0.042039)),
            *(ZERO, back, (0.0, 0.85), mimic, 2.0),
        ),
        J(
            *(f"{bar}_joint", "revolute", base, bar, (0.0, 0.02 * sign, 0.074098)),
            *(ZERO, closing, (0.0, 0.85), mimic, 2.0),
        ),
        Box(
            *(knuckle, (0.02, 0.012, 0.05), (0.0, 0.0177 * sign, 0.021)),
            (-sign * lean, 0.0, 0.0),
        ),
        Box(finger, (0.03, 0.02, 0.06), (0.0, -0.016 * sign, 0.031)),
        Box(
            *(bar, (0.02, 0.008, 0.045), (0.0, 0.0177 * sign, 0.021)),
            (-sign * lean, 0.0, 0.0),
        ),
    ]


XARM_GRIPPER: list[J | Box] = [
    J("mount", "fixed", "tool0", "xarm_gripper_base_link"),
    Box("xarm_gripper_base_link", (0.06, 0.09, 0.07), (0.0, 0.0, 0.035)),
    *_xarm_side("left", 1.0),
    *_xarm_side("right", -1.0),
    J("tip", "fixed", "xarm_gripper_base_link", "tcp", (0.0, 0.0, 0.172)),
]

RADIAL: list[J | Box] = [
    J("mount", "fixed", "tool0", "palm"),
    Box("palm", (0.08, 0.08, 0.04), (0.0, 0.0, 0.02)),
    *(
        hand
        for number, angle in enumerate((0.0, 2.0 * math.pi / 3.0, 4.0 * math.pi / 3.0), 1)
        for hand in (
            J(
                *(f"slide_{number}", "prismatic", "palm", f"digit_{number}", (0.0, 0.0, 0.04)),
                *((0.0, 0.0, angle), X, (0.0, 0.04)),
                mimic=None if number == 1 else ("slide_1", 1.0),
                speed=0.1,
            ),
            Box(f"digit_{number}", (0.01, 0.02, 0.06), (0.005, 0.0, 0.03)),
        )
    ),
    J("tip", "fixed", "palm", "tcp", (0.0, 0.0, 0.09)),
]
"""Three fingers that close on the middle from three directions."""

HOOK: list[J | Box] = [
    J("mount", "fixed", "tool0", "palm"),
    Box("palm", (0.04, 0.04, 0.02), (0.0, 0.0, 0.01)),
    J(
        *("slide", "prismatic", "palm", "hook", (0.0, 0.0, 0.1), ZERO, X, (0.05, 0.12)),
        speed=0.1,
    ),
    Box("hook", (0.01, 0.02, 0.06)),
    J("tip", "fixed", "palm", "tcp", (0.0, 0.0, 0.1)),
]
"""One finger that closes on nothing."""

VICE: list[J | Box] = [
    J("mount", "fixed", "tool0", "palm"),
    Box("palm", (0.04, 0.04, 0.1396), (0.0, 0.0, 0.0698)),
    J(
        *("slide", "prismatic", "palm", "cheek", (0.0, 0.0, 0.01), ZERO, X, (0.025, 0.08)),
        speed=0.1,
    ),
    Box("cheek", (0.01, 0.04, 0.02)),
    J("tip", "fixed", "palm", "tcp", (0.0, 0.0, 0.02)),
]
"""One jaw that slides towards the middle of the palm and of the flange of a UR5e."""


def hand_urdf(arm: str, hand: list[J | Box]) -> str:
    """Return the URDF of an arm of ``gripping_arms.HANDS`` with another hand on its flange."""
    stand = (
        '<link name="stand"/><joint name="stand_joint" type="fixed"><parent link="stand"/>'
        f'<child link="base_link"/><origin xyz="0 0 {STAND}"/></joint>'
    )
    joints = [part for part in hand if isinstance(part, J)]
    links = {joint.child: "" for joint in joints}
    for part in hand:
        if isinstance(part, Box):
            links[part.link] += _shape(part)
    parts = [f'<link name="{name}">{shapes}</link>' for name, shapes in links.items()]
    text = "".join([stand, *parts, *(joint.xml for joint in joints), "</robot>"])
    return chain_urdf("arm", HANDS[arm][0]).replace("</robot>", text)


CUP_HOLDER: list[J | Box] = [
    J("mount", "fixed", "tool0", "holder"),
    Box("holder", (0.04, 0.04, 0.06), (0.0, 0.0, 0.03)),
    J(
        *("suction_joint", "prismatic", "holder", "suction_cup", (0.0, 0.0, 0.06)),
        limits=(0.0, 0.015),
        speed=0.05,
    ),
    J("tip", "fixed", "holder", "tcp", (0.0, 0.0, 0.08)),
]


def suction_urdf(radius: float) -> str:
    """Return the URDF of a UR5e with a suction cup of that radius [m]."""
    shape = f'<geometry><cylinder radius="{radius}" length="0.02"/></geometry>'
    cup = f'<collision><origin xyz="0 0 0.01"/>{shape}</collision>'
    link = '<link name="suction_cup">'
    return hand_urdf("UR5e", CUP_HOLDER).replace(link, link + cup)


def so101_urdf() -> str:
    """Return the URDF of the included SO-101, which names its meshes by their whole paths."""
    file = INCLUDED["so101"]
    return file.read_text("utf-8").replace('filename="', f'filename="{file.parent}/')


PX150_BOXES = [
    Box("hand", (0.04, 0.05, 0.04), (0.01, 0.0, 0.0)),
    Box("left", (0.04, 0.01, 0.02), (0.02, 0.0, 0.0)),
    Box("right", (0.04, 0.01, 0.02), (0.02, 0.0, 0.0)),
]


def px150_urdf() -> str:
    """Return the URDF of a PincherX-150 with its two fingers."""
    return _with_boxes(urdf("px150", PX150), PX150_BOXES)


def _with_boxes(text: str, boxes: list[Box]) -> str:
    """Return the description with ``boxes`` for links without shapes."""
    for link in {box.link for box in boxes}:
        shapes = "".join(_shape(box) for box in boxes if box.link == link)
        assert f'<link name="{link}"/>' in text
        text = text.replace(f'<link name="{link}"/>', f'<link name="{link}">{shapes}</link>')
    return text


def _shape(box: Box) -> str:
    size, origin, rpy = (" ".join(map(repr, numbers)) for numbers in (box.size, box.at, box.rpy))
    shape = f'<origin xyz="{origin}" rpy="{rpy}"/><geometry><box size="{size}"/></geometry>'
    return f"<visual>{shape}</visual><collision>{shape}</collision>"
