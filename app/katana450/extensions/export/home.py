"""The posture in which the app's arm starts."""

from __future__ import annotations

from collections.abc import Mapping

from katana450.arm.robot.robot import Robot
from katana450.settings import Settings


def home_of(robot: Robot) -> Mapping[str, float]:
    """Return the value of every joint [rad or m] at the app's home; of a mechanism at zero."""
    arm = robot.arm
    if arm is None:
        return robot.every({})
    return robot.every(arm.joint_values(arm.ready(Settings.ready), arm.gripper.clamp(0.0)))
