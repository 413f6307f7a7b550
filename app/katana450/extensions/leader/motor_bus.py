"""The host's end of the bus: requests, and the answers of the motors within a deadline."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Protocol

from katana450.errors import KatanaError
from katana450.extensions.leader import packets
from katana450.extensions.leader.packets import MotorError, Packet, PacketReader, Register

BAUD = 1_000_000
"""[bit/s] Rate of an STS3215 as delivered."""

DEADLINE = 0.05
"""[s] Timeout for the answers to a request. Adapters for USB hold bytes back for up to 16 ms."""

READ_TIMEOUT, WRITE_TIMEOUT = 0.005, 1.0
"""[s] Timeouts of one read, which may return a part of an answer, and of a request."""

TRIES = 3
"""Number of times that a request is sent before the motor counts as silent."""


class SilentLeaderError(KatanaError):
    """A motor of the leader does not answer."""


class UnpluggedError(KatanaError):
    """The serial port of the leader cannot be opened, or is lost."""


class Port(Protocol):
    """A serial port. Its methods raise UnpluggedError."""

    def write(self, data: bytes, timeout: float) -> None:
        """Send ``data`` within ``timeout`` [s], and drop the bytes that wait to be read."""

    def read(self, timeout: float) -> bytes:
        """Return the bytes that arrive, which may be none, within ``timeout`` [s]."""


class MotorBus:
    """The motors at one port, asked one request at a time."""

    def __init__(self, port: Port) -> None:
        self._port = port
        self._reader = PacketReader()

    def read(self, motor: int, register: Register) -> int:
        """Return the value of ``register``. Raises SilentLeaderError after some tries."""
        return register.decoded(self._answer(packets.read(motor, register), register.size))

    def write(self, motor: int, register: Register, value: int) -> None:
        """Set ``register`` to ``value``. Raises SilentLeaderError after some tries."""
        self._answer(packets.write(motor, register, value), 0)

    def errors(self, motor: int) -> MotorError:
        """Return the errors that ``motor`` reports. Raises SilentLeaderError after some tries."""
        for _ in range(TRIES):
            found = self._exchange(packets.ping(motor), (motor,), 0)
            if motor in found:
                return MotorError(found[motor].code)
        raise self._silent((motor,))

    def read_all(self, motors: tuple[int, ...], register: Register) -> dict[int, int]:
        """Return the value of ``register`` of all ``motors``.

        Raises SilentLeaderError if one does not answer. The request is not repeated, because the
        next one asks for newer values.
        """
        found = self._exchange(packets.sync_read(motors, register), motors, register.size)
        if missing := [motor for motor in motors if motor not in found]:
            raise self._silent(missing)
        return {motor: register.decoded(found[motor].parameters) for motor in motors}

    def _answer(self, request: Packet, size: int) -> bytes:
        for _ in range(TRIES):
            found = self._exchange(request, (request.id,), size)
            if request.id in found:
                return found[request.id].parameters
        raise self._silent((request.id,))

    def _exchange(self, request: Packet, motors: tuple[int, ...], size: int) -> dict[int, Packet]:
        """Send ``request``; return the answers of ``motors`` with ``size`` bytes, by their ids."""
        self._reader.clear()
        self._port.write(request.encoded, WRITE_TIMEOUT)
        found: dict[int, Packet] = {}
        due = time.monotonic() + DEADLINE
        while len(found) < len(motors) and time.monotonic() < due:
            for packet in self._reader.feed(self._port.read(READ_TIMEOUT)):
                if packet.id in motors and len(packet.parameters) == size:
                    found[packet.id] = packet
        return found

    @staticmethod
    def _silent(motors: Iterable[int]) -> SilentLeaderError:
        names = ", ".join(map(str, motors))
        return SilentLeaderError(
            f"Of the leader's motors, these do not answer: {names}. Check its power, its cables "
            "and the ids in the calibration file."
        )
