"""Orientations of the tool in a recording, which follow from its joints."""

from __future__ import annotations

import numpy as np

from katana450.errors import InputError
from katana450.extensions.recording.datasets.recorded_robot import recorded_robot
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import rows
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.batch import forward_batch


def orientations(file: RecordingFile, start: float, end: float) -> FloatArray:
    """Return the unit quaternions (N, 4) x, y, z, w of the tool in the base frame.

    There is one for each state from ``start`` to ``end`` [s]. Raises InputError for a robot without
    a tool, and for a damaged recording.
    """
    arm = recorded_robot(file).arm
    found = list(rows(file, start, end))
    if arm is None:
        raise InputError(f"{file.path} has no orientation: its robot has joints only.")
    tools = [each.tool for each in found]
    shape = (len(found), arm.chain.n)
    joints = [each.joints for each in found]
    q = finite_array(joints, shape, f"The joints in {file.path}")
    quaternions = np.empty((len(found), 4))
    for tool in dict.fromkeys(tools):
        here = np.array([each == tool for each in tools])
        R = (arm.T_base_shoulder @ forward_batch(arm.chain_to(tool), q[here]))[:, :3, :3]
        quaternions[here] = [so3.to_quaternion(each)[[1, 2, 3, 0]] for each in R]
    return frozen(quaternions)
