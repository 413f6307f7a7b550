"""The robot of a recording, from the URDF that is attached to it, and the poses of its tool."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from katana450.arm.robot.robot import Robot, bare
from katana450.assembly.robot_files import read_robot
from katana450.assembly.robot_session import find_arm
from katana450.errors import InputError
from katana450.extensions.recording.files.header import Attachment
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import rows
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.batch import forward_batch

URDF, XACRO = ".urdf", ".xacro"
"""Ends of the names of descriptions."""


def attached_urdf(file: RecordingFile) -> Attachment:
    """Return the URDF of ``file``. Raises InputError without one."""
    name = file.metadata.get("urdf")
    for attachment in file.attachments():
        if attachment.name == name:
            return attachment
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


def orientations(file: RecordingFile, start: float, end: float) -> FloatArray:
    """Return the unit quaternions (N, 4) x, y, z, w of the tool in the base frame.

    There is one for each state from ``start`` to ``end`` [s]. Raises InputError for a robot without
    a tool, and for a damaged recording.
    """
    arm = recorded_robot(file).arm
    states = list(rows(file, start, end))
    if arm is None:
        raise InputError(f"{file.path} has no orientation: its robot has joints only.")
    tools = [state.tool for state in states]
    shape = (len(states), arm.chain.n)
    joints = [state.joints for state in states]
    q = finite_array(joints, shape, f"The joints in {file.path}")
    quaternions = np.empty((len(states), 4))
    for tool in dict.fromkeys(tools):
        mask = np.array([name == tool for name in tools])
        R = (arm.T_base_shoulder @ forward_batch(arm.chain_to(tool), q[mask]))[:, :3, :3]
        quaternions[mask] = [so3.to_quaternion(rotation)[[1, 2, 3, 0]] for rotation in R]
    return frozen(quaternions)
