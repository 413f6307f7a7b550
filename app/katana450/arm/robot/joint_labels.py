"""Names of the joints for people."""

from __future__ import annotations

from katana450.arm.control.state.messages import axis_names
from katana450.arm.robot.robot import Robot


def joint_labels(robot: Robot) -> tuple[str, ...]:
    """Return the label of each joint: its number, as in messages, and its name.

    Joints of an arm that the robot description only numbers have the names of a five-axis arm.
    """
    arm = robot.arm
    names = robot.joint_group.names if arm is None else axis_names(arm.chain.names)
    return tuple(f"{number} {name}" for number, name in enumerate(names, start=1))
