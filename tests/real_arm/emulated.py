"""An emulated arm for tests: in this process by simulated time, or as a process behind a port."""

from __future__ import annotations

import re
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from katana450.extensions.device_address import DeviceAddress
from katana450.extensions.real_arm.codec.replies import AxisStatus, FirmwareError
from katana450.extensions.real_arm.codec.requests import (
    ArmRequest,
    AxisSegment,
    CommandMotor,
    ErrorQuery,
    ReadPositions,
    ReadStates,
    SendSplines,
)
from katana450.extensions.real_arm.emulator.arm import EmulatedArm
from katana450.extensions.real_arm.emulator.firmware import Firmware
from katana450.extensions.real_arm.emulator.server import IDLE, EmulatorServer
from katana450.extensions.real_arm.link import ArmLink, open_arm

ROOT = Path(__file__).resolve().parents[2]

TIMEOUT = 20.0
"""[s] for anything that a process does."""


class FaultyServer(EmulatorServer):
    """A server that answers late, and whose connection can be reset."""

    def __init__(self, arm: EmulatedArm, reply_delay: Callable[[], float] = lambda: 0.0) -> None:
        """Serve ``arm``. ``reply_delay`` returns the time by which the next reply is late [s]."""
        super().__init__(arm)
        self._reply_delay = reply_delay
        self._dropping = threading.Event()

    def drop_client(self) -> None:
        """Reset the connection to the client, if there is one, within a turn of ``run``."""
        self._dropping.set()

    def _turn(self) -> None:
        if self._dropping.is_set():
            self._dropping.clear()
            with self.lock:
                if self._client is not None:
                    with suppress(OSError):
                        linger = struct.pack("ii", 1, 0)
                        self._client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
                self._drop()
        super()._turn()

    def _send(self, client: socket.socket, reply: bytes) -> bool:
        """Send ``reply`` after the delay, in which the arm moves."""
        end = time.monotonic() + self._reply_delay()
        while (left := end - time.monotonic()) > 0.0 and not self._ending.is_set():
            # Others may look at the arm meanwhile.
            self.lock.release()
            try:
                time.sleep(min(left, IDLE))
            finally:
                self.lock.acquire()
            self._advance()
        return super()._send(client, reply)


class Bench:
    """An arm with its firmware, driven by simulated time."""

    def __init__(self, arm: EmulatedArm) -> None:
        self.arm = arm
        self.firmware = Firmware(arm)

    def ask(self, request: ArmRequest) -> Any:
        return self.firmware.answer(request)

    def refused(self, request: ArmRequest) -> FirmwareError:
        """Return the error for which ``request`` is refused."""
        self.firmware.handle(request)
        error = self.firmware.answer(ErrorQuery())
        assert isinstance(error, FirmwareError)
        assert error.command == request.payload[0], "the request was not refused"
        return error

    def confine(self, axis: int, lower: float, upper: float) -> None:
        """Put obstacles in the way of ``axis``, from 1, at two places [counts]."""
        plant = self.arm.axes[axis - 1].plant
        plant.lower, plant.upper = lower, upper
        self.arm.touch()

    def block(self, axis: int) -> None:
        """Let ``axis``, from 1, stick where it is."""
        position = self.arm.axes[axis - 1].plant.position
        self.confine(axis, position, position)

    @property
    def states(self) -> tuple[int, ...]:
        states: tuple[int, ...] = self.ask(ReadStates()).states
        return states

    @property
    def positions(self) -> tuple[int, ...]:
        positions: tuple[int, ...] = self.ask(ReadPositions()).positions
        return positions

    def wait(self, seconds: float, *, step: float = 0.01) -> None:
        for _ in range(round(seconds / step)):
            self.arm.step(step)

    def wait_until(self, states: Collection[int], timeout: float) -> float:
        """Wait until each axis reports one of ``states``; return the simulated time it took."""
        start = self.arm.time
        while not set(self.states) <= set(states):
            assert self.arm.time < start + timeout, self.states
            self.arm.step(0.01)
        return self.arm.time - start

    def move(self, axis: int, target: int) -> None:
        self.ask(CommandMotor(axis, 24, target))

    def splines(self, axis: int, segments: list[AxisSegment], *, last: bool = True) -> None:
        """Send ``segments`` of one axis; the others stay where they are."""
        positions = self.positions
        for number, segment in enumerate(segments):
            still = [
                AxisSegment(segment.ticks, position, position, 0, 0, 0) for position in positions
            ]
            still[axis - 1] = segment
            more = 1 if last and number == len(segments) - 1 else 2 if not last else 0
            self.ask(SendSplines(tuple(still), more))


def at_rest(arm: EmulatedArm) -> bool:
    return all(axis.plant.speed == 0.0 for axis in arm.axes)


@contextmanager
def emulator_process(*options: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Run ``katana450 emulate``; return its process, which may be frozen or ended, and port."""
    process = subprocess.Popen(
        [sys.executable, "-m", "katana450", "emulate", "--port", "0", *options],
        stdout=subprocess.PIPE,
        cwd=ROOT,
        text=True,
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        match = re.search(r"tcp://127\.0\.0\.1:(\d+)", line)
        assert match, line
        yield process, int(match[1])
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=TIMEOUT)


@contextmanager
def linked(port: int) -> Iterator[ArmLink]:
    """Connect to an arm behind a port."""
    link = ArmLink(open_arm(DeviceAddress("127.0.0.1", port)))
    try:
        yield link
    finally:
        link.close()


HOLDS = {AxisStatus.FIXED, AxisStatus.SPLINES_DONE}
