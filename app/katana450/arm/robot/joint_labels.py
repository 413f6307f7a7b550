"""Names of the joints for people."""

from __future__ import annotations

import re

from katana450.arm.control.messages import AXIS_NAMES
from katana450.arm.robot.robot import Robot


def joint_labels(robot: Robot) -> tuple[str, ...]:
    """Return the label of each joint: its number, as in messages, and its name.

    Joints of an arm that the robot description only numbers have the names of a five-axis arm.
    """
    arm = robot.arm
    names = robot.joint_group.names if arm is None else arm.chain.names
    if arm is not None and all(re.fullmatch(r"axis_?\d+", name) for name in names):
        names = AXIS_NAMES
    return tuple(f"{number} {name}" for number, name in enumerate(names, start=1))
