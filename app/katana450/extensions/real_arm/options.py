"""Options of ``katana450 emulate`` and ``serve``, and the choice of driver and view.

Nothing heavy is loaded before it is used.
"""

from __future__ import annotations

import argparse
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from katana450.cli.option_values import number, port
from katana450.errors import ConfigurationError
from katana450.extensions.real_arm.link import PORT

SERVO_DRIVERS = ("so101", "koch", "omx")
"""Names of the arms of bus servos."""

if TYPE_CHECKING:
    from katana450.arm.drivers.driver import Driver
    from katana450.arm.robot.robot import Robot
    from katana450.maths.geometry.arrays import FloatArray
    from katana450.sdk import ViewLayer


def add_emulate_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 emulate`` to ``parser``."""
    parser.description = (
        "Emulate the firmware of a Katana450 behind a TCP port, or the motors of an SO-101, Koch "
        "or OMX behind a TCP port and a pseudo-terminal. It begins as an arm after power-up: a "
        "Katana450 is not calibrated, and motors are off."
    )
    parser.add_argument(
        "emulated",
        nargs="?",
        choices=("katana450", *SERVO_DRIVERS),
        default="katana450",
        help="the arm",
    )
    parser.add_argument("--port", type=port, help=f"0 for any free port (default: {PORT} or 5567)")
    parser.add_argument(
        "--calibration", type=Path, metavar="FILE", help="write the calibration of its motors there"
    )
    parser.add_argument(
        "--calibrated", action="store_true", help="begin calibrated and holding, for tests"
    )
    parser.add_argument(
        "--calibration-scale",
        type=number(1.0, 100.0),
        default=1.0,
        metavar="N",
        help="calibrate N times as fast, for tests (default: %(default)g)",
    )


def add_serve_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 serve`` to ``parser``."""
    parser.add_argument(
        "--device",
        metavar="ADDRESS",
        help="drive a real arm at tcp://HOST, tcp://HOST:PORT, or a serial port as /dev/ttyUSB0. "
        "No program is a safety device: a hardware stop button that cuts the power of the arm "
        "stays necessary, within reach of the person beside it.",
    )
    parser.add_argument(
        "--calibration",
        type=Path,
        metavar="FILE",
        help="calibration of the bus servos at --device, a JSON file of LeRobot",
    )
    parser.add_argument(
        "--driver",
        choices=SERVO_DRIVERS,
        help="the arm of bus servos at --device, with any description of five joints and a gripper "
        "(default: so101 with --calibration)",
    )
    parser.add_argument(
        "--reversed",
        action="append",
        default=[],
        metavar="MOTOR",
        help="a motor that turns against the joint of the description; may be given several times",
    )
    parser.add_argument(
        "--arm-log", type=Path, metavar="FILE", help="write all exchanges with a Katana450 there"
    )


def driver(options: Namespace, robot: Robot, q: FloatArray, gripper: float) -> Driver | None:
    """Return the driver of a real arm; None if the options name none.

    q: (n,) [rad] and gripper [rad] are reported before the first measurement. Raises KatanaError.
    """
    if options.device is None:
        for name in ("arm_log", "calibration", "driver", "reversed"):
            if getattr(options, name):
                option = "--" + name.replace("_", "-")
                raise ConfigurationError(f"{option} needs a real arm: add --device ADDRESS.")
        return None
    from katana450.extensions.motor_bus.calibration import AXES

    if options.calibration or options.driver or tuple(robot.require_arm().chain.names) == AXES:
        from katana450.extensions.real_arm.servo import driver as servo

        return servo.driver_of(options, robot, q, gripper)
    from katana450.extensions.real_arm.driver import katana_driver

    return katana_driver.driver_of(options, robot, q, gripper)


def view_layer(options: Namespace) -> ViewLayer | None:
    """Return the layer of a real arm whose posture may be unknown; None for a simulated one."""
    if options.device is None:
        return None
    from katana450.extensions.real_arm.unknown_posture import UnknownPosture

    return UnknownPosture()
