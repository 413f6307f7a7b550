"""Packets and registers of Feetech STS3215 servos.

A packet is ``FF FF id length code parameters checksum``. Its code is an instruction from the host,
or the error flags of a motor. Source: the memory table and protocol of Feetech's STS series.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import NamedTuple

HEADER = b"\xff\xff"

BROADCAST = 0xFE
"""Id to which a request to several motors is addressed."""

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
    """Read the same registers of several motors, which answer one after the other."""
    SYNC_WRITE = 0x83
    """Set the same register of several motors, which do not answer."""


class MotorError(IntFlag):
    """The code of a packet from a motor; 0 without an error."""

    VOLTAGE = 0x01
    ANGLE = 0x02
    OVERHEAT = 0x04
    OVERCURRENT = 0x08
    OVERLOAD = 0x20

    @property
    def words(self) -> str:
        """The errors in words, such as "overheat, overload"; empty without one."""
        return ", ".join(flag.name.lower() for flag in MotorError if flag in self and flag.name)


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


FIRMWARE, MODEL = Register(0, 2), Register(3, 2)
"""Version of the firmware, with the major part in the low byte, and number of the model."""

ID, BAUD = Register(5, 1), Register(6, 1)
"""Kept without power, like all up to the mode. A motor whose LOCK is 1 forgets what is written."""

MIN_POSITION, MAX_POSITION = Register(9, 2, 15), Register(11, 2, 15)
"""[ticks] Range that a motor leaves for no goal. It keeps it without power."""

HOMING_OFFSET = Register(31, 2, 11)
"""Actual minus reported position [ticks]. The motor keeps it without power."""

TORQUE_ENABLE, ACCELERATION = Register(40, 1), Register(41, 1)
GOAL_POSITION = Register(42, 2, 15)
"""[ticks]"""
TORQUE_LIMIT = Register(48, 2)
"""[1/1000 of the largest torque]"""
LOCK = Register(55, 1)
PRESENT_POSITION = Register(56, 2, 15)
"""[ticks]"""
PRESENT_SPEED = Register(58, 2, 15)
"""[ticks/s]"""
PRESENT_LOAD = Register(60, 2, 10)
"""[1/1000 of the largest torque]"""
PRESENT_VOLTAGE = Register(62, 1)
"""[0.1 V]"""
PRESENT_TEMPERATURE = Register(63, 1)
"""[degrees C]"""


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


def sync_read_request(motors: tuple[int, ...], address: int, size: int) -> Packet:
    """Return the request for ``size`` bytes from ``address`` on of all ``motors``."""
    return Packet(BROADCAST, Instruction.SYNC_READ, bytes((address, size, *motors)))


def sync_write_request(register: Register, values: Mapping[int, int]) -> Packet:
    """Return the request that sets ``register`` to the ``values`` by the ids of the motors."""
    rows = (bytes((motor,)) + register.encoded(value) for motor, value in values.items())
    head = bytes((register.address, register.size))
    return Packet(BROADCAST, Instruction.SYNC_WRITE, head + b"".join(rows))


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
