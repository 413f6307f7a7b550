"""The semantic description of a robot (SRDF), from which MoveIt plans."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import arm_session
from katana450.extensions.export.excluded_pairs import excluded_pairs
from katana450.extensions.export.home import home_of
from katana450.extensions.export.ros2.groups import ARM, GRIPPER, groups_of
from katana450.settings import Settings


def srdf_text(robot: Robot) -> str:
    """Return the SRDF: groups, their states, the end effector, and pairs that cannot collide."""
    root = ET.Element("robot", name=robot.name)
    groups = groups_of(robot)
    for group in groups:
        element = ET.SubElement(root, "group", name=group.name)
        if group.name == ARM and robot.arm is not None:
            base, tip = robot.links[0].name, robot.arm.default_tool
            ET.SubElement(element, "chain", base_link=base, tip_link=tip)
        for joint in group.joints if group.name != ARM else ():
            ET.SubElement(element, "joint", name=joint)
    states = {"home": home_of(robot), "zero": robot.every({})}
    for group in groups:
        for state in states if group.name == ARM else ("zero",):
            element = ET.SubElement(root, "group_state", name=state, group=group.name)
            for joint in group.joints:
                ET.SubElement(element, "joint", name=joint, value=repr(states[state][joint]))
    if robot.arm is not None and any(group.name == GRIPPER for group in groups):
        _add_gripper(root, robot, robot.arm)
    for follower in robot.joints.values():
        if follower.leader != follower.name:
            ET.SubElement(root, "passive_joint", name=follower.name)
    for first, second, reason in excluded_pairs(robot):
        ET.SubElement(root, "disable_collisions", link1=first, link2=second, reason=reason)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_gripper(root: ET.Element, robot: Robot, arm: MountedArm) -> None:
    """Add the end effector, and the states in which it is open and closed."""
    gripper = arm_session(Settings(), robot).robot.require_arm().gripper
    fingers = next(group for group in groups_of(robot) if group.name == GRIPPER)
    for state, end in (("closed", gripper.closed), ("open", gripper.opened)):
        element = ET.SubElement(root, "group_state", name=state, group=GRIPPER)
        for joint in fingers.joints:
            factor, offset = arm.fingers[joint]
            ET.SubElement(element, "joint", name=joint, value=repr(factor * end + offset))
    last = next(
        link for link in robot.links if link.joint and link.joint.name == arm.chain.names[-1]
    )
    ET.SubElement(
        root,
        "end_effector",
        name="hand",
        parent_link=last.name,
        group=GRIPPER,
        parent_group=ARM,
    )
