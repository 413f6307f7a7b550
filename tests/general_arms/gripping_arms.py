"""URDF files of published arms with a hand of two sliding fingers, of plain boxes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from tests.general_arms.chain_urdf import chain_urdf
from tests.general_arms.published_arms import KR_6, LEVEL, OPENMANIPULATOR_X, PANDA, TOOL, UR5E

FINGER = 0.02
"""[m] Width of a finger."""

STAND = 0.03
"""[m] Height of the base over the table, so that no link touches it."""


class Gripper(NamedTuple):
    """Sizes of a hand, on the z axis of the flange, whose fingers close along y [m].

    Attributes:
        palm: size of the palm along x, y, z.
        length: of the fingers.
        stroke: of each finger.
        tip: distance of the tool frame behind the fingertips.
    """

    palm: tuple[float, float, float]
    length: float
    stroke: float
    tip: float = 0.01


FRANKA_HAND = Gripper((0.063, 0.204, 0.0584), 0.0538, 0.04, 0.0088)
"""Franka Robotics: outer sizes of the hand, and the places of its joints."""

TWO_FINGERS = Gripper((0.06, 0.16, 0.07), 0.06, 0.0425)
WIDE = Gripper((0.03, 0.11, 0.02), 0.05, 0.04)
SMALL = Gripper((0.03, 0.07, 0.025), 0.05, 0.024)

FORWARD = se3.from_rotation_translation(
    np.array(((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))), np.array((0.055, 0.0, 0.0))
)
"""The flange of a four-axis arm in the frame of its last joint: z forward, y along that joint."""


def flange(chain: Chain, tool: FloatArray, T: FloatArray) -> Chain:
    """Return ``chain``, which ends in ``tool`` (4, 4), with the flange ``T`` (4, 4) instead."""
    return chain.with_tool(chain.M @ se3.inverse(tool) @ T)


def larger(chain: Chain, factor: float) -> Chain:
    """Return ``chain`` with all lengths times ``factor``, whose joints turn by 150 deg each way."""
    M, far = chain.M.copy(), np.full(chain.n, math.radians(150.0))
    M[:3, 3] *= factor
    S = chain.S * np.repeat((1.0, factor), 3)[:, None]
    return replace(chain, M=M, S=S, lower=-far, upper=far)


EIGHTH = se3.from_rotation_translation(so3.rotation_z(-0.25 * math.pi), np.zeros(3))

HANDS = {
    "Panda": (flange(PANDA, TOOL, EIGHTH), FRANKA_HAND),
    "UR5e": (flange(UR5E, TOOL, np.eye(4)), TWO_FINGERS),
    "OpenMANIPULATOR-X": (flange(OPENMANIPULATOR_X, LEVEL, FORWARD), SMALL),
    "four axes": (flange(OPENMANIPULATOR_X, LEVEL, FORWARD), WIDE),
    "four long axes": (flange(larger(OPENMANIPULATOR_X, 2.0), LEVEL, FORWARD), WIDE),
    "KR 6": (flange(KR_6, TOOL, np.eye(4)), TWO_FINGERS),
}
"""Arms with their hands."""


def gripping_urdf(name: str, *, mimic: bool = True, upside_down: bool = False) -> str:
    """Return the URDF of an arm of HANDS.

    mimic: whether the second finger mimics the first; else both are driven. upside_down: whether
    the fingers close towards the upper end of the range of their joint.
    """
    chain, gripper = HANDS[name]
    stand = (
        '<link name="stand"/><joint name="stand_joint" type="fixed"><parent link="stand"/>'
        f'<child link="base_link"/><origin xyz="0 0 {STAND}"/></joint>'
    )
    hand = _hand(gripper, mimic, upside_down)
    return chain_urdf("arm", chain).replace("</robot>", stand + hand)


def _hand(gripper: Gripper, mimic: bool, upside_down: bool) -> str:
    thick = 0.5 * FINGER
    palm = _box("hand", gripper.palm, (0.0, 0.0, 0.5 * gripper.palm[2]))
    size = (FINGER, thick, gripper.length)
    lower, upper = (-gripper.stroke, 0.0) if upside_down else (0.0, gripper.stroke)
    parts = [palm, _fixed("hand", "tool0", 0.0)]
    for finger, side in (("left", 1.0), ("right", -1.0)):
        sign = -side if upside_down else side
        follow = '<mimic joint="finger_left"/>' if mimic and finger == "right" else ""
        parts.append(_box(finger, size, (0.0, 0.5 * side * thick, 0.5 * gripper.length)))
        parts.append(
            f'<joint name="finger_{finger}" type="prismatic"><parent link="hand"/>'
            f'<child link="{finger}"/><origin xyz="0 0 {gripper.palm[2]}"/>'
            f'<axis xyz="0 {sign} 0"/><limit lower="{lower}" upper="{upper}" velocity="0.1" '
            f'effort="20"/>{follow}</joint>'
        )
    tip = gripper.palm[2] + gripper.length - gripper.tip
    return "".join([*parts, '<link name="tcp"/>', _fixed("tcp", "hand", tip), "</robot>"])


def _box(name: str, size: tuple[float, ...], origin: tuple[float, ...]) -> str:
    shape = (
        f'<origin xyz="{" ".join(map(str, origin))}"/>'
        f'<geometry><box size="{" ".join(map(str, size))}"/></geometry>'
    )
    return f'<link name="{name}"><visual>{shape}</visual><collision>{shape}</collision></link>'


def _fixed(link: str, parent: str, z: float) -> str:
    return (
        f'<joint name="{link}_joint" type="fixed"><parent link="{parent}"/><child link="{link}"/>'
        f'<origin xyz="0 0 {z}"/></joint>'
    )
