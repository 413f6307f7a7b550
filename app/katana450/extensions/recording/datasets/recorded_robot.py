"""The robot of a recording, from the URDF that is attached to it."""

from __future__ import annotations

import tempfile
from pathlib import Path

from katana450.arm.robot.bare import bare
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_files import read_robot
from katana450.assembly.robot_session import find_arm
from katana450.errors import InputError
from katana450.extensions.recording.files.header import Attachment
from katana450.extensions.recording.files.recording_file import RecordingFile

URDF, XACRO = ".urdf", ".xacro"
"""Ends of the names of descriptions."""


def attached_urdf(file: RecordingFile) -> Attachment:
    """Return the URDF of ``file``. Raises InputError without one."""
    name = file.metadata.get("urdf")
    for each in file.attachments():
        if each.name == name:
            return each
    raise InputError(f"{file.path} has no URDF attached, so the names of its joints are unknown.")


def recorded_robot(file: RecordingFile) -> Robot:
    """Return the robot of ``file``: links and joints, without meshes.

    Raises InputError or RobotDescriptionError if its description is missing or invalid.
    """
    urdf = attached_urdf(file)
    settings = file.settings
    # The name comes from the file, so only its end is used, which tells what to expand.
    name = f"robot{XACRO if urdf.name.endswith(XACRO) else URDF}"
    with tempfile.TemporaryDirectory(prefix="katana450-") as folder:
        path = Path(folder) / name
        path.write_bytes(urdf.data)
        robot = read_robot(path, settings.tool, find_arm)
        return bare(robot) if settings.bare else robot
