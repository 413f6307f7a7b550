"""The extension ``real_arm``: the real Katana450, an emulator of it, and a simulated plant."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from katana450.errors import ConfigurationError
from katana450.extension import CliCommand, Extension, ServeExtension
from katana450.extensions.real_arm.commands.options import (
    add_arm_command_options,
    add_emulate_options,
    add_serve_options,
)

if TYPE_CHECKING:
    from katana450.arm.drivers.driver import Driver
    from katana450.arm.robot.robot import Robot
    from katana450.maths.geometry.arrays import FloatArray
    from katana450.server.view.layer import ViewLayer


def _emulate(options: Namespace) -> int:
    from katana450.extensions.real_arm.commands.emulate import emulate

    return emulate(options)


def _arm(options: Namespace) -> int:
    if options.act == "probe":
        from katana450.extensions.real_arm.commands.probe import probe

        return probe(options)
    from katana450.extensions.real_arm.commands.exchange_lines import show_log

    return show_log(options)


def _driver(options: Namespace, robot: Robot, q: FloatArray, gripper: float) -> Driver | None:
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


def _view_layer(options: Namespace) -> ViewLayer | None:
    if options.arm is None:
        return None
    from katana450.extensions.real_arm.unknown_posture import UnknownPosture

    return UnknownPosture()


EXTENSION = Extension(
    "real_arm",
    (
        CliCommand(
            "arm",
            "probe a real arm, or show its log",
            add_arm_command_options,
            _arm,
        ),
        CliCommand(
            "emulate",
            "emulate the firmware of a Katana450 behind a TCP port",
            add_emulate_options,
            _emulate,
        ),
    ),
    ServeExtension(add_serve_options, view_layer=_view_layer, driver=_driver),
)
