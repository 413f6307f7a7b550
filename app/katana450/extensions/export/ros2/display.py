"""Launch files of the exported ROS 2 package, and what RViz shows."""

from __future__ import annotations

from collections.abc import Sequence

from katana450.arm.robot.robot import Robot

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
        History Policy: Keep Last
        Depth: 1
        Reliability Policy: Reliable
    - Class: rviz_default_plugins/TF
      Name: Frames
      Enabled: false
      Value: false
  Enabled: true
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
    """Return the configuration of RViz: grid, robot and frames, seen from outside its bounds."""
    low, high = robot.bounds
    x, y, z = (0.5 * (low + high)).tolist()
    return _RVIZ.format(
        root=robot.links[0].name.replace("'", "''"),
        distance=VIEW_DISTANCE * float(((high - low) ** 2).sum() ** 0.5),
        x=x,
        y=y,
        z=z,
    )
