"""Reading a robot from its URDF file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from katana450.arm.robot.arm_reader import FindArm, arm_in
from katana450.arm.robot.description import checked, explained, unexpanded
from katana450.arm.robot.link import Joint, Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.urdf import Urdf, driver_of, urdf_of
from katana450.arm.robot.visual import rods
from katana450.errors import RobotDescriptionError
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH

MOVABLE = ("revolute", "continuous", "prismatic")
"""Supported types of movable joints."""


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
    readable: dict[str, Joint] = {}
    faults: list[str] = []
    for joint in urdf.joints.values():
        fault = _fault(path, joint)
        if fault:
            faults.append(fault)
        elif joint.type != "fixed":
            readable[joint.name] = joint
    following: dict[str, Joint] = {}
    for name, joint in readable.items():
        driver = driver_of(joint, readable)
        if driver is not None:
            leader, factor, offset = driver
            following[name] = replace(joint, leader=leader, factor=factor, offset=offset)
        elif joint.mimic is not None:
            faults.append(
                f"Joint {name!r} of {path.name} mimics {joint.mimic.joint!r}, which is not "
                "driven and follows no driven joint. Name a driven joint in its <mimic>."
            )
    below: dict[str, list[FloatArray]] = {name: [] for name in urdf.links}
    for joint in urdf.joints.values():
        below[joint.parent].append(joint.T_parent_child[:3, 3])
    links = []
    for name in urdf.parents_first():
        link, parent_joint = urdf.links[name], above.get(name)
        if parent_joint is not None:
            link = replace(
                link,
                parent=parent_joint.parent,
                T_parent_link=parent_joint.T_parent_child,
                joint=following.get(parent_joint.name),
            )
        links.append(replace(link, visuals=link.visuals or rods(below[name])))
    return tuple(links), tuple(faults)


def _fault(path: Path, joint: Joint) -> str:
    """Return a sentence on why ``joint`` cannot be read; empty if it can."""
    if joint.type == "fixed":
        return ""
    if joint.type not in MOVABLE:
        return (
            f"Joint {joint.name!r} of {path.name} is {joint.type}, which is not supported. Change "
            f"its type to one of fixed, {', '.join(MOVABLE)}."
        )
    return "" if joint.axis.any() else f"Joint {joint.name!r} of {path.name} has no axis."
