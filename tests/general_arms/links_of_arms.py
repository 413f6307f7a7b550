"""URDF file of a published arm with links of plain shapes, for servers with a page."""

from __future__ import annotations

import math

QUARTER = math.pi / 2.0

UR5E_JOINTS = (
    ("shoulder_pan_joint", 0.0, 0.0, 0.1625),
    ("shoulder_lift_joint", QUARTER, 0.0, 0.0),
    ("elbow_joint", 0.0, -0.425, 0.0),
    ("wrist_1_joint", 0.0, -0.3922, 0.1333),
    ("wrist_2_joint", QUARTER, 0.0, 0.0997),
    ("wrist_3_joint", -QUARTER, 0.0, 0.0996),
)
"""Name, twist [rad], length [m] and offset [m] of each joint: Universal Robots, DH parameters."""

UR5E_SHAPES = (
    ((0.0, 0.0, 0.05), (0.0, 0.0), 0.075, 0.1),
    ((0.0, 0.0, -0.02), (0.0, 0.0), 0.06, 0.13),
    ((-0.2125, 0.0, 0.138), (0.0, QUARTER), 0.055, 0.5),
    ((-0.196, 0.0, 0.007), (0.0, QUARTER), 0.045, 0.45),
    ((0.0, 0.0, -0.03), (0.0, 0.0), 0.045, 0.12),
    ((0.0, 0.0, -0.03), (0.0, 0.0), 0.045, 0.12),
    ((0.0, 0.0, -0.03), (0.0, 0.0), 0.037, 0.06),
)
"""Centre [m], pitch and yaw [rad], radius and length [m] of the cylinder of each link."""

COLOURS = ("0.55 0.58 0.62 1", "0.30 0.62 0.80 1")


def ur5e() -> str:
    """Return a URDF of a UR5e with its flange."""
    names = ("base_link", "shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
    links = []
    for number, (name, shape) in enumerate(zip(names, UR5E_SHAPES, strict=True)):
        (x, y, z), (roll, pitch), radius, length = shape
        geometry = (
            f'<origin xyz="{x} {y} {z}" rpy="{roll} {pitch} 0"/>'
            f'<geometry><cylinder radius="{radius}" length="{length}"/></geometry>'
        )
        colour = f'<material name="m{number}"><color rgba="{COLOURS[number % 2]}"/></material>'
        links.append(
            f'<link name="{name}"><visual>{geometry}{colour}</visual>'
            f"<collision>{geometry}</collision></link>"
        )
    joints = []
    for number, (name, twist, length, offset) in enumerate(UR5E_JOINTS):
        y, z = -offset * math.sin(twist), offset * math.cos(twist)
        joints.append(
            f'<joint name="{name}" type="revolute"><parent link="{names[number]}"/>'
            f'<child link="{names[number + 1]}"/>'
            f'<origin xyz="{length} {y} {z}" rpy="{twist} 0 0"/><axis xyz="0 0 1"/>'
            f'<limit lower="{-2 * math.pi}" upper="{2 * math.pi}" velocity="3.14" effort="150"/>'
            "</joint>"
        )
    flange = (
        '<link name="tool0"/><joint name="flange" type="fixed"><parent link="wrist_3"/>'
        '<child link="tool0"/><origin xyz="0 0 0" rpy="0 0 0"/></joint>'
    )
    return "\n".join(['<robot name="ur5e">', *links, *joints, flange, "</robot>"])
