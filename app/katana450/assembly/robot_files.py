"""Files of robots, also in xacro."""

from __future__ import annotations

from pathlib import Path

from katana450.arm.robot.arm_reader import FindArm
from katana450.arm.robot.description import checked
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.extension import load as load_part
from katana450.resources import URDF_PATH

EXPAND = "katana450.extensions.xacro.xacro_file:expanded"
"""Function that expands xacro."""


def read_robot(
    path: Path = URDF_PATH, tool: str | None = None, find: FindArm | None = None
) -> Robot:
    """Return the robot in the file at ``path``, also in xacro; see ``load``."""
    return load(path, tool, find, _expand)


def read_urdf(path: Path) -> bytes:
    """Return the URDF at ``path``, also from xacro; see ``checked``."""
    return checked(path, _expand)


def _expand(path: Path) -> bytes:
    """Return the URDF of a file in xacro. Raises RobotDescriptionError."""
    urdf: bytes = load_part(EXPAND)(path)
    return urdf
