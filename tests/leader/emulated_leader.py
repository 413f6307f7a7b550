"""An emulated leader arm: the motors of an SO-101 behind a pseudo-terminal."""

from __future__ import annotations

import json
import math
import os
import select
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Self

from katana450.extensions.motor_bus.packets import (
    BROADCAST,
    HOMING_OFFSET,
    MAX_POSITION,
    MIN_POSITION,
    PRESENT_POSITION,
    TORQUE_ENABLE,
    TURN,
    Instruction,
    Packet,
    PacketReader,
    Register,
)

MOTORS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
RANGE = (700, 3395)
"""[ticks] Extremes of each motor."""
OFFSETS = (-37, 1200, 0, -2047, 15, 2047)
"""[ticks] Homing offsets."""

Motion = Callable[[float], Sequence[float]]
"""Angles of the six motors [rad] from the middle of their ranges, at a time [s]."""

STILL = (0.0,) * 6

START = (0.1, 0.0, 0.2, 0.1, 0.0, 0.0)
"""A posture [rad] that the arm can take."""


def calibration() -> dict[str, dict[str, int]]:
    """Return the calibration of the emulated leader, as LeRobot writes it."""
    return {
        name: {
            "id": number,
            "drive_mode": 0,
            "homing_offset": offset,
            "range_min": RANGE[0],
            "range_max": RANGE[1],
        }
        for number, (name, offset) in enumerate(zip(MOTORS, OFFSETS, strict=True), start=1)
    }


def write_calibration(path: Path) -> Path:
    path.write_text(json.dumps(calibration(), indent=4), encoding="utf-8")
    return path


class EmulatedMotors:
    """The motors' end of the bus: bytes of requests in, bytes of answers out.

    Attributes:
        angles: angles of the motors [rad] from the middle of their ranges.
        torque: whether each motor holds its position.
        silent: ids of motors that do not answer.
    """

    def __init__(self) -> None:
        self.angles: Sequence[float] = STILL
        self.torque = [True] * len(MOTORS)
        self.silent: set[int] = set()
        self._reader = PacketReader()

    def answer(self, data: bytes) -> bytes:
        return b"".join(
            status.encoded
            for request in self._reader.feed(data)
            for status in self._answers(request)
            if status.id not in self.silent
        )

    def _answers(self, request: Packet) -> list[Packet]:
        ids = range(1, len(MOTORS) + 1)
        data = request.parameters
        if request.code == Instruction.SYNC_READ and request.id == BROADCAST:
            motors = [motor for motor in data[2:] if motor in ids]
            return [Packet(motor, 0, self._memory(motor, data[0], data[1])) for motor in motors]
        if request.id not in ids:
            return []
        if request.code == Instruction.READ:
            return [Packet(request.id, 0, self._memory(request.id, data[0], data[1]))]
        if request.code == Instruction.WRITE and data[0] == TORQUE_ENABLE.address:
            self.torque[request.id - 1] = bool(data[1])
        return [Packet(request.id, 0)]

    def position(self, motor: int) -> int:
        """Return the position of ``motor`` [ticks]."""
        return round(sum(RANGE) / 2.0 + self.angles[motor - 1] * TURN / (2.0 * math.pi))

    def _memory(self, motor: int, address: int, size: int) -> bytes:
        values: dict[Register, int] = {
            MIN_POSITION: RANGE[0],
            MAX_POSITION: RANGE[1],
            HOMING_OFFSET: OFFSETS[motor - 1],
            TORQUE_ENABLE: int(self.torque[motor - 1]),
            PRESENT_POSITION: self.position(motor),
        }
        memory = bytearray(128)
        for register, value in values.items():
            data = register.encoded(value)
            memory[register.address : register.address + register.size] = data
        return bytes(memory[address : address + size])


class EmulatedLeader:
    """A context manager around the motors at a pseudo-terminal, which a thread answers.

    Attributes:
        port: name of the serial port.
        motors: the motors.
        motion: their angles by time.
    """

    def __init__(self, motion: Motion = lambda _: STILL) -> None:
        self.motion = motion
        self.motors = EmulatedMotors()
        self._end, self._inner = os.openpty()
        # A program that reads nothing loses answers, and does not hold the thread up.
        os.set_blocking(self._end, False)
        self.port = os.ttyname(self._inner)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, name="emulated leader")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.unplug()

    def unplug(self) -> None:
        """Remove the port."""
        if not self._ends.is_set():
            self._ends.set()
            self._thread.join()
            os.close(self._inner)
            os.close(self._end)

    def _run(self) -> None:
        while not self._ends.is_set():
            if not select.select([self._end], [], [], 0.02)[0]:
                continue
            self.motors.angles = self.motion(time.monotonic())
            with suppress(BlockingIOError):
                os.write(self._end, self.motors.answer(os.read(self._end, 4096)))
