"""The posture in which the app's arm starts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.maths.geometry.arrays import FloatArray
from katana450.settings import Settings


def home_of(robot: Robot) -> Mapping[str, float]:
    """Return the value of every joint [rad or m] at the app's home; of a mechanism at zero."""
    arm = robot.arm
    if arm is None:
        return robot.every({})
    *q, gripper = home_vector(robot).tolist()
    return robot.every(arm.joint_values(np.array(q), gripper))


def home_vector(robot: Robot) -> FloatArray:
    """Return `home_of` as the joint values (k,) [rad or m] of a collision world of ``robot``."""
    arm = robot.arm
    if arm is None:
        home = robot.every({})
        return np.array([*(home[name] for name in robot.driven), 0.0])
    return np.append(arm.ready(Settings.ready), arm.gripper.clamp(0.0))
