"""An emulated leader arm: the motors of an SO-101 behind a pseudo-terminal, moved by a hand."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Self

from katana450.extensions.motor_bus.feetech import FEETECH
from katana450.extensions.motor_bus.packets import TURN
from katana450.extensions.real_arm.emulator.server import ServoServer
from katana450.extensions.real_arm.servo.emulated_servos import EmulatedServos, calibration_text

RANGE = (700, 3395)
"""[ticks] Extremes of each motor."""

Motion = Callable[[float], Sequence[float]]
"""Angles of the six motors [rad] from the middle of their ranges, at a time [s]."""

STILL = (0.0,) * 6

START = (0.1, 0.0, 0.2, 0.1, 0.0, 0.0)
"""A posture [rad] that the arm can take."""


def calibration() -> dict[str, dict[str, int]]:
    """Return the calibration of the emulated leader, as LeRobot writes it."""
    ends = {"range_min": RANGE[0], "range_max": RANGE[1]}
    return {name: motor | ends for name, motor in json.loads(calibration_text()).items()}


def write_calibration(path: Path) -> Path:
    path.write_text(json.dumps(calibration(), indent=4), encoding="utf-8")
    return path


class EmulatedMotors(EmulatedServos):
    """The motors' end of the bus, at first with their torque on.

    Attributes:
        motion: angles of the motors [rad] from the middle of their ranges, by time.
    """

    def __init__(self, motion: Motion = lambda _: STILL) -> None:
        self.motion = motion
        super().__init__()
        for motor in self.motors:
            motor[FEETECH.min_position], motor[FEETECH.max_position] = RANGE
            motor[FEETECH.torque_enable] = 1

    def step(self, seconds: float) -> None:  # noqa: ARG002
        """Put the motors where the hand has them."""
        self.place(self.motion(time.monotonic()))

    def place(self, angles: Sequence[float]) -> None:
        """Put the motors at ``angles`` [rad] from the middle of their ranges."""
        for motor, angle in zip(self.motors, angles, strict=True):
            motor.place = sum(RANGE) / 2.0 + angle * TURN / math.tau
            motor.publish()

    @property
    def torque(self) -> list[int]:
        return [motor[FEETECH.torque_enable] for motor in self.motors]

    def answer(self, data: bytes) -> bytes:
        return b"".join(self.replies(data))


class EmulatedLeader:
    """A context manager around the motors at a pseudo-terminal, which a thread answers.

    Attributes:
        port: name of the serial port.
        motors: the motors.
    """

    def __init__(self, motion: Motion = lambda _: STILL) -> None:
        self.motors = EmulatedMotors(motion)
        self._server = ServoServer(self.motors)
        self.port = self._server.terminal

    def __enter__(self) -> Self:
        self._server.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Remove the port."""
        self._server.stop()
