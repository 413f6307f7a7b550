"""The files by which ROS 2 shows, drives and plans an exported robot.

Groups of joints, ros2_control, SRDF, manifest, launch files, and what RViz shows.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from typing import NamedTuple
from xml.sax.saxutils import escape, quoteattr

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import arm_session
from katana450.extensions.export.rest import excluded_pairs, home_of
from katana450.settings import Settings

ARM, GRIPPER, JOINTS = "arm", "gripper", "joints"
"""Names of the groups: of an arm, of its fingers, and of a mechanism without an arm."""


class JointGroup(NamedTuple):
    """Joints that are commanded together."""

    name: str
    joints: tuple[str, ...]

    @property
    def controller(self) -> str:
        """The name of its controller."""
        return f"{self.name}_controller"


def groups_of(robot: Robot) -> list[JointGroup]:
    """Return the groups of the driven joints; other driven joints of an arm are in none."""
    if robot.arm is None:
        return [JointGroup(JOINTS, robot.driven)] if robot.driven else []
    chain = robot.arm.chain.names
    fingers = tuple(name for name in robot.driven if name in robot.arm.fingers)
    return [JointGroup(ARM, chain), *([JointGroup(GRIPPER, fingers)] if fingers else [])]


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


USED = (
    "controller_manager",
    "gripper_controllers",
    "hardware_interface",
    "joint_state_broadcaster",
    "joint_state_publisher_gui",
    "joint_trajectory_controller",
    "launch",
    "launch_ros",
    "robot_state_publisher",
    "rviz2",
    "xacro",
)
"""Packages that the launch files need; none of them is needed to build."""

CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({name} NONE)
find_package(ament_cmake REQUIRED)
install(DIRECTORY {folders} DESTINATION share/${{PROJECT_NAME}})
ament_package()
"""
"""Template of CMakeLists.txt."""

MANIFEST = """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>{robot}: URDF, meshes, ros2_control and SRDF</description>
  <maintainer email="todo@todo.todo">TODO: Maintainer</maintainer>
  <license>{license}</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
{used}
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""
"""Template of package.xml. Its placeholders are those of ROS's package generator."""


def manifest_text(package: str, robot: str, license_name: str) -> str:
    """Return `package.xml` of the ``package`` of a ``robot``."""
    return MANIFEST.format(
        name=package,
        robot=escape(robot),
        license=license_name,
        used="\n".join(f"  <exec_depend>{name}</exec_depend>" for name in USED),
    )


def cmake_text(package: str, files: Iterable[str]) -> str:
    """Return `CMakeLists.txt`, which installs the folders of ``files``."""
    folders = sorted({name.partition("/")[0] for name in files})
    return CMAKE.format(name=package, folders=" ".join(folders))


RVIZ = "display.rviz"
"""Name of the file for RViz."""

_HEAD = '''\
"""{what}"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.substitutions import Command
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

PACKAGE = Path(get_package_share_directory("{package}"))
'''

_DISPLAY = (
    _HEAD
    + '''

def generate_launch_description():
    """Return the nodes."""
    description = (PACKAGE / "urdf" / "{urdf}").read_text(encoding="utf-8")
    return LaunchDescription([
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            parameters=[{{"robot_description": ParameterValue(description, value_type=str)}}],
        ),
        Node(package="joint_state_publisher_gui", executable="joint_state_publisher_gui"),
        Node(
            package="rviz2",
            executable="rviz2",
            arguments=["-d", str(PACKAGE / "rviz" / "{rviz}")],
        ),
    ])
'''
).replace("from launch.substitutions import Command\n", "")

_CONTROL = (
    _HEAD
    + '''

def generate_launch_description():
    """Return the nodes."""
    command = Command(["xacro ", str(PACKAGE / "urdf" / "{xacro}")])
    description = {{"robot_description": ParameterValue(command, value_type=str)}}
    return LaunchDescription([
        Node(
            package="robot_state_publisher",
            executable="robot_state_publisher",
            parameters=[description],
        ),
        Node(
            package="controller_manager",
            executable="ros2_control_node",
            parameters=[str(PACKAGE / "config" / "controllers.yaml")],
            remappings=[("~/robot_description", "/robot_description")],
        ),
        *(
            Node(package="controller_manager", executable="spawner", arguments=[name])
            for name in {controllers}
        ),
        Node(
            package="rviz2",
            executable="rviz2",
            arguments=["-d", str(PACKAGE / "rviz" / "{rviz}")],
        ),
    ])
'''
)

_RVIZ = """\
Panels:
  - Class: rviz_common/Displays
    Name: Displays
Visualization Manager:
  Class: ""
  Displays:
    - Class: rviz_default_plugins/Grid
      Name: Grid
      Enabled: true
      Value: true
      Cell Size: 0.1
      Plane Cell Count: 20
    - Class: rviz_default_plugins/RobotModel
      Name: Robot
      Enabled: true
      Value: true
      Description Source: Topic
      Description Topic:
        Value: /robot_description
        Durability Policy: Transient Local
  Global Options:
    Fixed Frame: '{root}'
    Frame Rate: 30
  Tools:
    - Class: rviz_default_plugins/MoveCamera
  Views:
    Current:
      Class: rviz_default_plugins/Orbit
      Name: Current View
      Distance: {distance:.2f}
      Focal Point:
        X: {x:.3f}
        Y: {y:.3f}
        Z: {z:.3f}
      Pitch: 0.4
      Yaw: 0.8
"""

VIEW_DISTANCE = 1.2
"""Distance of RViz's camera as a ratio of the diagonal of the box around the robot."""


def display_launch(package: str, urdf: str) -> str:
    """Return a launch file that shows the robot with a slider per joint."""
    return _DISPLAY.format(
        what="Show the robot in RViz, with a slider for each joint.",
        package=package,
        urdf=urdf,
        rviz=RVIZ,
    )


def control_launch(package: str, xacro: str, controllers: Sequence[str]) -> str:
    """Return a launch file that runs ros2_control with a mock system."""
    return _CONTROL.format(
        what="Run the controllers on a mock system, and show the robot in RViz.",
        package=package,
        xacro=xacro,
        controllers=list(controllers),
        rviz=RVIZ,
    )


def rviz_text(robot: Robot) -> str:
    """Return the configuration of RViz: grid and robot, seen from outside its bounds."""
    low, high = robot.bounds
    x, y, z = (0.5 * (low + high)).tolist()
    return _RVIZ.format(
        root=robot.links[0].name.replace("'", "''"),
        distance=VIEW_DISTANCE * float(((high - low) ** 2).sum() ** 0.5),
        x=x,
        y=y,
        z=z,
    )
