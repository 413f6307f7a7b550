"""The choice of driver and view of ``katana450 serve``, and of the work of ``katana450 arm``.

It loads nothing heavy before it is used.
"""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from katana450.errors import ConfigurationError

if TYPE_CHECKING:
    from katana450.arm.drivers.driver import Driver
    from katana450.arm.robot.robot import Robot
    from katana450.maths.geometry.arrays import FloatArray
    from katana450.sdk import ViewLayer


def arm(options: Namespace) -> int:
    """Execute ``katana450 arm``; return the exit status."""
    if options.act == "probe":
        from katana450.extensions.real_arm.commands.probe import probe

        return probe(options)
    from katana450.extensions.real_arm.commands.exchange_lines import show_log

    return show_log(options)


def driver(options: Namespace, robot: Robot, q: FloatArray, gripper: float) -> Driver | None:
    """Return the driver of a real arm or a plant; None if the options choose neither.

    q: (n,) [rad] and gripper [rad] are reported before the first measurement. Raises KatanaError.
    """
    if options.arm is not None:
        from katana450.extensions.real_arm.commands.serve_arm import driver_of

        return driver_of(options, robot, q, gripper)
    if options.arm_log is not None:
        raise ConfigurationError("--arm-log needs an arm: add --arm URL.")
    if options.plant is None:
        return None
    from katana450.extensions.real_arm.plant.driver import PlantDriver
    from katana450.extensions.real_arm.plant.profile import profile_named

    return PlantDriver(robot, q, gripper, profile_named(options.plant))


def view_layer(options: Namespace) -> ViewLayer | None:
    """Return the layer of a real arm whose posture may be unknown; None for a simulated one."""
    if options.arm is None:
        return None
    from katana450.extensions.real_arm.unknown_posture import UnknownPosture

    return UnknownPosture()
