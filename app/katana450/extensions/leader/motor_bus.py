"""The bus of Feetech STS3215 servos: packets, requests, and answers within a deadline.

A packet is ``FF FF id length code parameters checksum``. Its code is an instruction from the host,
or the error flags of a motor. Source: the memory table and protocol of Feetech's STS series.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import NamedTuple, Protocol

from katana450.errors import KatanaError

HEADER = b"\xff\xff"

BROADCAST = 0xFE
"""Id to which a sync read is addressed."""

MAX_ID = 0xFD
"""Highest id of a motor."""

MAX_LENGTH = 0x80
"""Highest value [bytes] of the length field that is taken for a packet; no request here is longer.
"""

FIXED_BYTES = 6
"""Bytes of a packet without parameters."""

TURN = 4096
"""Ticks per turn."""


class Instruction(IntEnum):
    """The code of a packet from the host."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    SYNC_READ = 0x82
    """Read the same register of several motors, which answer one after the other."""


class MotorError(IntFlag):
    """The code of a packet from a motor; 0 without an error."""

    VOLTAGE = 0x01
    ANGLE = 0x02
    OVERHEAT = 0x04
    OVERCURRENT = 0x08
    OVERLOAD = 0x20


class Register(NamedTuple):
    """A value in the memory of a motor, little endian.

    Attributes:
        address: address of its first byte.
        size: number of bytes.
        sign_bit: number of the bit that is the sign of the other ones; None for values without one.
    """

    address: int
    size: int
    sign_bit: int | None = None

    def encoded(self, value: int) -> bytes:
        """Return the bytes of ``value``. Raises OverflowError if they cannot hold it."""
        if self.sign_bit is not None:
            limit = 1 << self.sign_bit
            if abs(value) >= limit:
                raise OverflowError(f"{value} needs more than {self.sign_bit} bits.")
            value = limit - value if value < 0 else value
        return value.to_bytes(self.size, "little")

    def decoded(self, data: bytes) -> int:
        """Return the value of ``data``."""
        value = int.from_bytes(data, "little")
        if self.sign_bit is None or not value >> self.sign_bit & 1:
            return value
        return -(value & ((1 << self.sign_bit) - 1))


HOMING_OFFSET = Register(31, 2, 11)
"""Actual minus reported position [ticks]."""

TORQUE_ENABLE = Register(40, 1)
PRESENT_POSITION = Register(56, 2, 15)
"""[ticks]"""


@dataclass(frozen=True)
class Packet:
    """A packet.

    Attributes:
        id: number of the motor, or BROADCAST.
        code: instruction of the host, or error flags of the motor.
        parameters: the rest of its content.
    """

    id: int
    code: int
    parameters: bytes = b""

    @property
    def encoded(self) -> bytes:
        """The bytes of the packet."""
        body = bytes((self.id, len(self.parameters) + 2, self.code)) + self.parameters
        return HEADER + body + bytes((checksum(body),))


def checksum(body: bytes) -> int:
    """Return the checksum of the bytes between the header and the checksum."""
    return ~sum(body) & 0xFF


def ping_request(motor: int) -> Packet:
    """Return the request for a sign that ``motor`` is there."""
    return Packet(motor, Instruction.PING)


def read_request(motor: int, register: Register) -> Packet:
    """Return the request for the value of ``register``."""
    return Packet(motor, Instruction.READ, bytes((register.address, register.size)))


def write_request(motor: int, register: Register, value: int) -> Packet:
    """Return the request that sets ``register`` to ``value``."""
    data = bytes((register.address,)) + register.encoded(value)
    return Packet(motor, Instruction.WRITE, data)


def sync_read_request(motors: tuple[int, ...], register: Register) -> Packet:
    """Return the request for the value of ``register`` of all ``motors``."""
    data = bytes((register.address, register.size, *motors))
    return Packet(BROADCAST, Instruction.SYNC_READ, data)


class PacketReader:
    """Finds packets in a stream of bytes, however it is split, and skips all other bytes."""

    def __init__(self) -> None:
        self._rest = bytearray()

    def clear(self) -> None:
        """Forget the start of a packet that has not ended."""
        self._rest.clear()

    def feed(self, data: bytes) -> list[Packet]:
        """Return the packets that ``data`` completes."""
        self._rest += data
        packets, place, rest = [], 0, self._rest
        while (place := rest.find(HEADER, place)) >= 0 and len(rest) - place >= FIXED_BYTES:
            motor, length = rest[place + 2], rest[place + 3]
            end = place + 4 + length
            if motor <= BROADCAST and 2 <= length <= MAX_LENGTH:
                if end > len(rest):
                    break
                body = bytes(rest[place + 2 : end - 1])
                if rest[end - 1] == checksum(body):
                    packets.append(Packet(motor, body[2], body[3:]))
                    place = end
                    continue
            # The header may be part of garbage.
            place += 1
        # The last byte may be the first half of a header.
        del rest[: place if place >= 0 else max(len(rest) - 1, 0)]
        return packets


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
        return register.decoded(self._answer(read_request(motor, register), register.size))

    def write(self, motor: int, register: Register, value: int) -> None:
        """Set ``register`` to ``value``. Raises SilentLeaderError after some tries."""
        self._answer(write_request(motor, register, value), 0)

    def errors(self, motor: int) -> MotorError:
        """Return the errors that ``motor`` reports. Raises SilentLeaderError after some tries."""
        for _ in range(TRIES):
            packets = self._exchange(ping_request(motor), (motor,), 0)
            if motor in packets:
                return MotorError(packets[motor].code)
        raise self._silent((motor,))

    def read_all(self, motors: tuple[int, ...], register: Register) -> dict[int, int]:
        """Return the value of ``register`` of all ``motors``.

        Raises SilentLeaderError if one does not answer. The request is not repeated, because the
        next one asks for newer values.
        """
        packets = self._exchange(sync_read_request(motors, register), motors, register.size)
        if missing := [motor for motor in motors if motor not in packets]:
            raise self._silent(missing)
        return {motor: register.decoded(packets[motor].parameters) for motor in motors}

    def _answer(self, request: Packet, size: int) -> bytes:
        for _ in range(TRIES):
            packets = self._exchange(request, (request.id,), size)
            if request.id in packets:
                return packets[request.id].parameters
        raise self._silent((request.id,))

    def _exchange(self, request: Packet, motors: tuple[int, ...], size: int) -> dict[int, Packet]:
        """Send ``request``; return the answers of ``motors`` with ``size`` bytes, by their ids."""
        self._reader.clear()
        self._port.write(request.encoded, WRITE_TIMEOUT)
        packets: dict[int, Packet] = {}
        due = time.monotonic() + DEADLINE
        while len(packets) < len(motors) and time.monotonic() < due:
            for packet in self._reader.feed(self._port.read(READ_TIMEOUT)):
                if packet.id in motors and len(packet.parameters) == size:
                    packets[packet.id] = packet
        return packets

    @staticmethod
    def _silent(motors: Iterable[int]) -> SilentLeaderError:
        names = ", ".join(map(str, motors))
        return SilentLeaderError(
            f"Of the leader's motors, these do not answer: {names}. Check its power, its cables "
            "and the ids in the calibration file."
        )
