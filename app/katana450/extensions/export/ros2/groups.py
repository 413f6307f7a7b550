"""The driven joints of a robot in groups, each with a controller and a planning group."""

from __future__ import annotations

from typing import NamedTuple

from katana450.arm.robot.robot import Robot

ARM, GRIPPER, JOINTS = "arm", "gripper", "joints"
"""Names of the groups: of an arm, of its fingers, and of a mechanism without an arm."""


class JointGroup(NamedTuple):
    """Joints that are commanded together."""

    name: str
    joints: tuple[str, ...]

    @property
    def controller(self) -> str:
        """The name of its controller."""
        return f"{self.name}_controller"


def groups_of(robot: Robot) -> list[JointGroup]:
    """Return the groups of the driven joints; other driven joints of an arm are in none."""
    if robot.arm is None:
        return [JointGroup(JOINTS, robot.driven)] if robot.driven else []
    chain = robot.arm.chain.names
    fingers = tuple(name for name in robot.driven if name in robot.arm.fingers)
    return [JointGroup(ARM, chain), *([JointGroup(GRIPPER, fingers)] if fingers else [])]
