"""An emulated arm of bus servos on a real socket, and its driver in a control loop."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from katana450.arm.control.state.arm_report import ArmAct, ArmMode
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.motor_bus.calibration import Calibration, decoded_calibration
from katana450.extensions.real_arm.emulator.server import ServoServer
from katana450.extensions.real_arm.servo.arms import SERVO_ARMS, ServoArm
from katana450.extensions.real_arm.servo.driver import ServoDriver
from katana450.extensions.real_arm.servo.emulated_servos import EmulatedServos, calibration_text
from katana450.extensions.real_arm.servo.joints import ServoJoints
from katana450.extensions.real_arm.tool_travel import tool_travel
from katana450.resources import INCLUDED
from tests.real_arm.control_loop import SmallLoop, swing

PATIENCE = 15.0
"""[s] For anything that a loaded machine may do late."""


SO101 = SERVO_ARMS["so101"]


def calibration(kind: ServoArm = SO101) -> Calibration:
    return decoded_calibration(calibration_text(kind))


def so101() -> Robot:
    return load(INCLUDED["so101"])


@contextmanager
def served(kind: ServoArm = SO101) -> Iterator[ServoServer]:
    server = ServoServer(EmulatedServos(kind))
    server.start()
    try:
        yield server
    finally:
        server.stop()


@contextmanager
def driven(
    server: ServoServer,
    robot: Robot,
    address: DeviceAddress | None = None,
    own: Calibration | None = None,
    kind: ServoArm = SO101,
) -> Iterator[SmallLoop]:
    """Yield a loop with the driver of the arm of ``server``, which is not connected."""
    joints = ServoJoints(own or calibration(kind), robot, kind)
    address = address or DeviceAddress("127.0.0.1", server.port)
    loop = SmallLoop(ServoDriver(address, joints, np.zeros(6), tool_travel(robot)))
    try:
        yield loop
    finally:
        loop.end()


def engage(loop: SmallLoop) -> None:
    """Let the motors hold the arm, and let it follow its setpoint from where it is."""
    if not loop.report.mode.follows:
        connect(loop)
        loop.act(ArmAct.ENGAGE, ArmMode.HOLDING, PATIENCE)
    loop.clear_stop()


def connect(loop: SmallLoop) -> None:
    """Connect, again if a busy machine has answered too late."""
    end = time.perf_counter() + PATIENCE
    while loop.report.mode is not ArmMode.CONNECTED:
        assert time.perf_counter() < end, loop.report.note
        if loop.report.mode is ArmMode.DISCONNECTED and "Connecting" not in loop.report.note:
            loop.driver.perform(ArmAct.CONNECT, 0.0)
        time.sleep(0.05)


def move(loop: SmallLoop, size: float = 0.5) -> None:
    """Let the setpoint swing away from where the arm is."""
    loop.setpoint = swing(loop.measured, time.perf_counter(), size)
    loop.wait(ArmMode.MOVING, PATIENCE)


def wait_until(holds: Callable[[], bool], what: str) -> None:
    end = time.perf_counter() + PATIENCE
    while not holds():
        assert time.perf_counter() < end, what
        time.sleep(0.01)
