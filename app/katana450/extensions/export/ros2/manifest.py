"""`package.xml` and `CMakeLists.txt` of the exported ROS 2 package."""

from __future__ import annotations

from collections.abc import Iterable
from xml.sax.saxutils import escape

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
