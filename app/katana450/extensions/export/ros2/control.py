"""ros2_control for a robot: a simulated system without dynamics, and its controllers."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from xml.sax.saxutils import quoteattr

from katana450.arm.robot.robot import Robot
from katana450.extensions.export.home import home_of
from katana450.extensions.export.ros2.groups import GRIPPER, JointGroup, groups_of

XACRO = "http://www.ros.org/wiki/xacro"
"""Namespace of xacro."""

FOLLOW = "joint_trajectory_controller/JointTrajectoryController"
GRIP = "position_controllers/GripperActionController"
"""Controllers with the action `follow_joint_trajectory`, and `gripper_cmd` as on our server."""

UPDATE_RATE = 100
"""[Hz] Rate of the controllers."""


def control_xacro(robot: Robot, urdf: str) -> str:
    """Return a xacro file with the file ``urdf`` beside it and a section <ros2_control>.

    The mock system takes positions as they are commanded and begins at the app's home. Joints that
    follow another have a state only: the system computes it.
    """
    home = home_of(robot)
    section = ET.Element("ros2_control", name="mock", type="system")
    hardware = ET.SubElement(section, "hardware")
    ET.SubElement(hardware, "plugin").text = "mock_components/GenericSystem"
    for joint in robot.joints.values():
        element = ET.SubElement(section, "joint", name=joint.name)
        if joint.leader != joint.name:
            # Distributions before Jazzy read it here, later ones in the URDF.
            ET.SubElement(element, "param", name="mimic").text = joint.leader
            ET.SubElement(element, "param", name="multiplier").text = repr(joint.factor)
        else:
            ET.SubElement(element, "command_interface", name="position")
        state = ET.SubElement(element, "state_interface", name="position")
        ET.SubElement(state, "param", name="initial_value").text = repr(home[joint.name])
        ET.SubElement(element, "state_interface", name="velocity")
    ET.indent(section, level=1)
    return (
        '<?xml version="1.0"?>\n'
        f'<robot xmlns:xacro="{XACRO}" name={quoteattr(robot.name)}>\n'
        f"  <xacro:include filename={quoteattr(urdf)}/>\n"
        f"  {ET.tostring(section, encoding='unicode')}\n</robot>\n"
    )


def controllers_yaml(robot: Robot) -> str:
    """Return the parameters of the controller manager and of one controller per group."""
    groups = groups_of(robot)
    lines = [
        "controller_manager:",
        "  ros__parameters:",
        f"    update_rate: {UPDATE_RATE}",
        "    joint_state_broadcaster:",
        "      type: joint_state_broadcaster/JointStateBroadcaster",
    ]
    for group in groups:
        lines += [f"    {group.controller}:", f"      type: {GRIP if _grips(group) else FOLLOW}"]
    for group in groups:
        lines += ["", f"{group.controller}:", "  ros__parameters:"]
        if _grips(group):
            lines.append(f"    joint: {_quoted(group.joints[0])}")
            continue
        lines += [
            "    joints:",
            *(f"      - {_quoted(joint)}" for joint in group.joints),
            "    command_interfaces:",
            "      - position",
            "    state_interfaces:",
            "      - position",
            "      - velocity",
        ]
    return "\n".join((*lines, ""))


def _grips(group: JointGroup) -> bool:
    """Return whether the group is a gripper of one driven joint, the only kind that GRIP drives."""
    return group.name == GRIPPER and len(group.joints) == 1


def _quoted(name: str) -> str:
    """Return ``name`` as a string of YAML."""
    return "'" + name.replace("'", "''") + "'"
