"""Small descriptions of commercial and printed arms, made from their published numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

QUARTER, HALF = math.pi / 2.0, math.pi
Triple = tuple[float, float, float]
Z: Triple = (0.0, 0.0, 1.0)
Y: Triple = (0.0, 1.0, 0.0)
X: Triple = (1.0, 0.0, 0.0)


class J(NamedTuple):
    """A joint and its child link; ``limits`` is None for a joint without limits."""

    name: str
    type: str
    parent: str
    child: str
    xyz: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)
    axis: Triple = Z
    limits: tuple[float, float] | None = (-2.0, 2.0)
    mimic: tuple[str, float] | None = None
    speed: float = 1.0

    @property
    def xml(self) -> str:
        """The joint as an element of a URDF."""
        numbers = {
            name: " ".join(map(repr, getattr(self, name))) for name in ("xyz", "rpy", "axis")
        }
        lines = [
            f'<joint name="{self.name}" type="{self.type}">',
            f'  <parent link="{self.parent}"/><child link="{self.child}"/>',
            f'  <origin xyz="{numbers["xyz"]}" rpy="{numbers["rpy"]}"/>',
        ]
        if self.type != "fixed":
            ends = self.limits and f' lower="{self.limits[0]!r}" upper="{self.limits[1]!r}"'
            lines.append(f'  <axis xyz="{numbers["axis"]}"/>')
            lines.append(f'  <limit{ends or ""} velocity="{self.speed!r}" effort="1"/>')
        if self.mimic is not None:
            lines.append(f'  <mimic joint="{self.mimic[0]}" multiplier="{self.mimic[1]!r}"/>')
        return "\n".join([*lines, "</joint>"])


def urdf(name: str, joints: Sequence[J]) -> str:
    """Return the text of a URDF without shapes."""
    links = dict.fromkeys(link for joint in joints for link in (joint.parent, joint.child))
    parts = [f'<link name="{link}"/>' for link in links]
    return "\n".join([f'<robot name="{name}">', *parts, *(j.xml for j in joints), "</robot>"])


def written(folder: Path, name: str, joints: Sequence[J]) -> Path:
    """Write ``urdf`` to a file of its name in ``folder`` and return the path."""
    path = folder / f"{name}.urdf"
    path.write_text(urdf(name, joints), encoding="utf-8")
    return path


def katana(wrist: float, tool: Triple, *, turned: bool = False) -> list[J]:
    """Return a Katana as in its ROS driver, with two driven fingers that do not mimic each other.

    wrist: distance from axis 4 to 5 [m]. tool: frame on link 5. turned: whether the z axis of link
    5 is along the roll axis.
    """
    bent = (QUARTER, 0.0, -QUARTER) if turned else (-QUARTER, 0.0, QUARTER)
    level = (0.0, QUARTER if turned else 0.0, 0.0)
    fingers = [
        J(
            *(name, "revolute", "gripper", f"{name}_finger", (0.034, 0.0, 0.0), (roll, 0.0, 0.0)),
            limits=(-0.44, 0.30),
            speed=0.718834,
        )
        for name, roll in (("r", 0.0), ("l", HALF))
    ]
    return [
        J("pan", "revolute", "base", "l1", (0.0, 0.0, 0.2015), limits=(-3.025528, 2.891097)),
        J("lift_2", "revolute", "l1", "l2", rpy=(QUARTER, 0.0, 0.0), limits=(-0.135, 2.1686)),
        J("lift_3", "revolute", "l2", "l3", (0.19, 0.0, 0.0), limits=(-2.2218, 2.0542)),
        J("lift_4", "revolute", "l3", "l4", (0.139, 0.0, 0.0), (HALF, 0.0, 0.0)),
        J("roll", "revolute", "l4", "l5", (wrist, 0.0, 0.0), bent),
        J("grip", "fixed", "l5", "gripper", tool, level),
        *fingers,
        J("frame", "fixed", "l5", "tool_frame", tool, (0.0, QUARTER, 0.0)),
    ]


KATANAS = {
    "katana_300": katana(0.1523, (0.0, 0.0, -0.1505), turned=True),
    "katana_400": katana(0.1473, (0.0, 0.0, -0.1505), turned=True),
    "katana_450a": katana(0.1473, (0.0, 0.0, -0.11), turned=True),
    "katana_450b": katana(0.1473, (0.0, 0.0, 0.1505)),
    "katana_450_on_a_box": [
        J("box", "fixed", "floor", "base", (0.0, 0.0, 0.1)),
        *katana(0.1473, (0.0, 0.0, 0.1505)),
    ],
}


def interbotix(*axes: J) -> list[J]:
    """Return an arm of the X series, with an endless horn and two sliding fingers."""
    last = axes[-1].child
    return [
        *axes,
        J("ee_arm", "fixed", last, "ee_arm", (0.043, 0.0, 0.0)),
        J("gripper", "continuous", "ee_arm", "prop", (0.0055, 0.0, 0.0), axis=X, limits=None),
        J("bar", "fixed", "ee_arm", "fingers", (0.023, 0.0, 0.0)),
        J("left_finger", "prismatic", "fingers", "left", axis=Y, limits=(0.015, 0.037)),
        J(
            *("right_finger", "prismatic", "fingers", "right"),
            axis=Y,
            limits=(-0.037, -0.015),
            mimic=("left_finger", -1.0),
        ),
        J("ee_gripper", "fixed", "fingers", "ee_gripper", (0.027575, 0.0, 0.0)),
    ]


SHOULDER = (
    J("waist", "revolute", "base", "shoulder_link", (0.0, 0.0, 0.07), limits=(-HALF, HALF)),
    J("shoulder", "revolute", "shoulder_link", "upper", (0.0, 0.0, 0.04), axis=Y),
)

PX100 = interbotix(
    *SHOULDER,
    J("elbow", "revolute", "upper", "fore", (0.035, 0.0, 0.1), axis=Y),
    J("wrist_angle", "revolute", "fore", "hand", (0.1, 0.0, 0.0), axis=Y),
)

PX150 = interbotix(
    *SHOULDER,
    J("elbow", "revolute", "upper", "fore", (0.05, 0.0, 0.15), axis=Y),
    J("wrist_angle", "revolute", "fore", "wrist", (0.15, 0.0, 0.0), axis=Y),
    J("wrist_rotate", "revolute", "wrist", "hand", (0.065, 0.0, 0.0), axis=X, limits=(-HALF, HALF)),
)

VX300S = interbotix(
    *SHOULDER,
    J("elbow", "revolute", "upper", "fore", (0.06, 0.0, 0.3), axis=Y),
    J("forearm_roll", "revolute", "fore", "low", (0.2, 0.0, 0.0), axis=X),
    J("wrist_angle", "revolute", "low", "wrist", (0.1, 0.0, 0.0), axis=Y),
    J("wrist_rotate", "revolute", "wrist", "hand", (0.07, 0.0, 0.0), axis=X, limits=(-HALF, HALF)),
)

YOUBOT_FINGERS = [
    J(
        *(name, "prismatic", "hand", link, (0.0, y, 0.0), (0.0, 0.0, turn)),
        axis=(0.0, -1.0, 0.0),
        limits=(0.0, 0.0115),
    )
    for name, link, y, turn in (
        ("finger_l", "left", 0.008, HALF),
        ("finger_r", "right", -0.008, 0.0),
    )
]
"""Two fingers that do not mimic each other."""

UR5 = [
    J("shoulder_pan", "revolute", "base", "l1", (0.0, 0.0, 0.089159)),
    J("shoulder_lift", "revolute", "l1", "l2", (0.0, 0.13585, 0.0), (0.0, QUARTER, 0.0), Y),
    J("elbow", "revolute", "l2", "l3", (0.0, -0.1197, 0.425), axis=Y),
    J("wrist_1", "revolute", "l3", "l4", (0.0, 0.0, 0.39225), (0.0, QUARTER, 0.0), Y),
    J("wrist_2", "revolute", "l4", "l5", (0.0, 0.093, 0.0)),
    J("wrist_3", "revolute", "l5", "l6", (0.0, 0.0, 0.09465), axis=Y),
    J("ee", "fixed", "l6", "ee_link", (0.0, 0.0823, 0.0)),
]

Z1 = [
    J("joint1", "revolute", "link00", "link01", (0.0, 0.0, 0.0585)),
    J("joint2", "revolute", "link01", "link02", (0.0, 0.0, 0.045), axis=Y),
    J("joint3", "revolute", "link02", "link03", (-0.35, 0.0, 0.0), axis=Y),
    J("joint4", "revolute", "link03", "link04", (0.218, 0.0, 0.057), axis=Y),
    J("joint5", "revolute", "link04", "link05", (0.07, 0.0, 0.0)),
    J("joint6", "revolute", "link05", "link06", (0.0492, 0.0, 0.0), axis=X, limits=(-2.79, 2.79)),
]

Z1_WITH_JAW = [
    *Z1,
    J("jointGripper", "revolute", "link06", "mover", (0.05, 0.0, 0.0), axis=Y, limits=(-1.57, 0.0)),
]

ROLLS_TWICE = [
    *PX150[:5],
    J("sixth", "revolute", "hand", "flange_6", (0.05, 0.0, 0.0), axis=Y, limits=(-1.0, 1.0)),
]
"""Six axes of which the first five are an arm of the family."""

SO101 = [
    J(
        *("shoulder_pan", "revolute", "base", "shoulder"),
        (0.0388353, -8.97657e-09, 0.0624),
        (3.14159, 4.18253e-17, -3.14159),
        limits=(-1.91986, 1.91986),
    ),
    J(
        *("shoulder_lift", "revolute", "shoulder", "upper_arm"),
        (-0.0303992, -0.0182778, -0.0542),
        (-1.5708, -1.5708, 0.0),
        limits=(-1.74533, 1.74533),
    ),
    J(
        *("elbow_flex", "revolute", "upper_arm", "lower_arm"),
        (-0.11257, -0.028, 1.73763e-16),
        (-3.63608e-16, 8.74301e-16, 1.5708),
        limits=(-1.69, 1.69),
    ),
    J(
        *("wrist_flex", "revolute", "lower_arm", "wrist"),
        (-0.1349, 0.0052, 3.62355e-17),
        (4.02456e-15, 8.67362e-16, -1.5708),
        limits=(-1.65806, 1.65806),
    ),
    J(
        *("wrist_roll", "revolute", "wrist", "gripper_link"),
        (5.55112e-17, -0.0611, 0.0181),
        (1.5708, 0.0486795, 3.14159),
        limits=(-2.74385, 2.84121),
    ),
    J(
        *("gripper_frame", "fixed", "gripper_link", "gripper_frame_link"),
        (-0.0079, -0.000218121, -0.0981274),
        (0.0, 3.14159, 0.0),
    ),
    J(
        *("gripper", "revolute", "gripper_link", "moving_jaw"),
        (0.0202, 0.0188, -0.0234),
        (1.5708, -5.24284e-08, -1.41553e-15),
        limits=(-0.174533, 1.74533),
    ),
]
"""Joints with the rounding of the published file: angles of six digits."""


def two_sided(joints: Sequence[J]) -> list[J]:
    """Return two arms on one base, with ``left_`` and ``right_`` before their names."""
    return [
        joint._replace(
            name=f"{side}_{joint.name}",
            child=f"{side}_{joint.child}",
            parent=joint.parent if joint.parent == "base" else f"{side}_{joint.parent}",
        )
        for side in ("left", "right")
        for joint in joints
    ]


def stewart() -> list[J]:
    """Return a Stewart platform: six legs of three joints each between a base and one plate."""
    return [
        J(name, kind, parent, child)
        for leg in range(1, 7)
        for name, kind, parent, child in (
            (f"hip_{leg}", "continuous", "base", f"lower_{leg}"),
            (f"strut_{leg}", "prismatic", f"lower_{leg}", f"upper_{leg}"),
            (f"ball_{leg}", "continuous", f"upper_{leg}", "plate"),
        )
    ]
