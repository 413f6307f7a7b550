"""The extension ``bodies``: contacts of robots outside the five-axis family."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension

if TYPE_CHECKING:
    from katana450.arm.robot.robot import Robot
    from katana450.extension import RobotWorld


def _world(robot: Robot) -> RobotWorld:
    from katana450.extensions.bodies.robot_world import robot_world

    return robot_world(robot)


EXTENSION = Extension("bodies", world=_world)
