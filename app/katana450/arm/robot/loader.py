"""Reading a robot from its URDF file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from katana450.arm.robot.arm_reader import FindArm, arm_in
from katana450.arm.robot.description import checked, explained, unexpanded
from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.urdf import Urdf, UrdfJoint, driver_of, urdf_of
from katana450.arm.robot.visual import rods
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.resources import URDF_PATH

MOVABLE = {"revolute": False, "continuous": False, "prismatic": True}
"""Supported types of movable joints, and whether each slides."""


def load(
    path: Path = URDF_PATH,
    tool: str | None = None,
    find: FindArm | None = None,
    expand: Callable[[Path], bytes] = unexpanded,
) -> Robot:
    """Read the robot in a URDF file.

    A link without shapes that has child links is drawn as thin rods. Meshes are read on first use.

    Args:
        path: the URDF file.
        tool: link to which targets refer by default; None for the first of TOOL_FRAMES that exists,
            else the last link behind five turning joints.
        find: finds the kinematics of an arm outside the five-axis family; None to leave it without.
        expand: returns the URDF of a xacro file.

    Raises:
        RobotDescriptionError: the file cannot be read, or there is no arm with that ``tool``. The
            message says what is wrong, and in which line.
    """
    data = checked(path, expand)
    with explained(path):
        urdf = urdf_of(data, path.parent)
        links, faults = _links_of(urdf, path)
    arm, why = None, ""
    try:
        with explained(path):
            arm = arm_in(urdf, path, tool, find)
    except RobotDescriptionError as error:
        if tool is not None:
            raise
        why = str(error)
    missing = [mesh for link in urdf.links.values() for files in link.missing for mesh in files]
    notes = tuple(f"There is no mesh at {mesh}." for mesh in dict.fromkeys(missing))
    return Robot(urdf.name, links, arm, why, notes, faults, path)


def _links_of(urdf: Urdf, path: Path) -> tuple[tuple[Link, ...], tuple[str, ...]]:
    """Return the tree, parents first, and sentences on its joints that cannot be moved."""
    above = {joint.child: joint for joint in urdf.joints.values()}
    readable: dict[str, UrdfJoint] = {}
    joints: dict[str, Joint] = {}
    faults: list[str] = []
    for described in urdf.joints.values():
        try:
            if described.type != "fixed":
                joints[described.name] = _joint(path, described)
                readable[described.name] = described
        except RobotDescriptionError as error:
            faults.append(str(error))
    following: dict[str, Joint] = {}
    for name, described in readable.items():
        leader = driver_of(described, readable)
        if leader is not None:
            named, factor, offset = leader
            following[name] = replace(joints[name], leader=named, factor=factor, offset=offset)
        elif described.mimic is not None:
            faults.append(
                f"Joint {name!r} of {path.name} mimics {described.mimic.joint!r}, which is not "
                "driven and follows no driven joint. Name a driven joint in its <mimic>."
            )
    below: dict[str, list[FloatArray]] = {name: [] for name in urdf.links}
    for described in urdf.joints.values():
        below[described.parent].append(described.origin[:3, 3])
    links = []
    for name in urdf.parents_first():
        link, parent_joint = urdf.links[name], above.get(name)
        links.append(
            Link(
                name=name,
                parent=None if parent_joint is None else parent_joint.parent,
                T_parent_link=frozen(np.eye(4)) if parent_joint is None else parent_joint.origin,
                joint=None if parent_joint is None else following.get(parent_joint.name),
                visuals=link.visuals or rods(below[name]),
                collisions=link.collisions,
                inertial=link.inertial,
                missing=link.missing,
            )
        )
    return tuple(links), tuple(faults)


def _joint(path: Path, joint: UrdfJoint) -> Joint:
    if joint.type not in MOVABLE:
        raise RobotDescriptionError(
            f"Joint {joint.name!r} of {path.name} is {joint.type}, which is not supported. Change "
            f"its type to one of fixed, {', '.join(MOVABLE)}."
        )
    size = float(np.linalg.norm(joint.axis))
    if not 0.0 < size < math.inf:
        raise RobotDescriptionError(f"Joint {joint.name!r} of {path.name} has no axis.")
    lower, upper, speed, effort = -math.inf, math.inf, math.inf, 0.0
    if joint.limit is not None:
        if joint.type != "continuous":
            lower = lower if joint.limit.lower is None else joint.limit.lower
            upper = upper if joint.limit.upper is None else joint.limit.upper
        speed = speed if joint.limit.velocity is None else joint.limit.velocity
        effort = joint.limit.effort or 0.0
    return Joint(
        name=joint.name,
        slides=MOVABLE[joint.type],
        axis=frozen(joint.axis / size),
        lower=lower,
        upper=upper,
        leader=joint.name,
        speed=speed,
        effort=effort,
        damping=joint.damping,
        friction=joint.friction,
    )
