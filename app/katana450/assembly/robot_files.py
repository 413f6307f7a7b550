"""Files of robots, read with the help of extensions."""

from __future__ import annotations

from pathlib import Path

from katana450.arm.robot.arm_reader import FindArm
from katana450.arm.robot.description import checked, unexpanded
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.extension import provided
from katana450.resources import URDF_PATH


def read_robot(
    path: Path = URDF_PATH, tool: str | None = None, find: FindArm | None = None
) -> Robot:
    """Return the robot in the file at ``path``, also in xacro; see ``load``."""
    return load(path, tool, find, _expand)


def read_urdf(path: Path) -> bytes:
    """Return the URDF at ``path``, also from xacro; see ``checked``."""
    return checked(path, _expand)


def _expand(path: Path) -> bytes:
    """Return the URDF that an extension makes of xacro. Raises RobotDescriptionError."""
    urdf: bytes = next(provided("expand"), unexpanded)(path)
    return urdf
