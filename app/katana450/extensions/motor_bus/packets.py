"""Packets on a bus of servos, and what the servos of a maker have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

BROADCAST = 0xFE
"""Id to which a request to several motors is addressed."""

MAX_ID = 0xFD
"""Highest id of a motor."""

MAX_LENGTH = 0x80
"""Highest value [bytes] of the length field that is taken for a packet; no request here is longer.
"""

TURN = 4096
"""Ticks per turn."""


class Instruction(IntEnum):
    """The code of a packet from the host."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REBOOT = 0x08
    """Start again, as after power-up. Only Dynamixel motors know it."""
    SYNC_READ = 0x82
    """Read the same registers of several motors, which answer one after the other."""
    SYNC_WRITE = 0x83
    """Set the same register of several motors, which do not answer."""


class Register(NamedTuple):
    """A value in the memory of a motor, little endian.

    Attributes:
        address: address of its first byte.
        size: number of bytes.
        sign_bit: number of the bit that is the sign of the other ones; None for values without one.
        complement: whether it is a two's complement.
    """

    address: int
    size: int
    sign_bit: int | None = None
    complement: bool = False

    def encoded(self, value: int) -> bytes:
        """Return the bytes of ``value``. Raises OverflowError if they cannot hold it."""
        if self.sign_bit is not None:
            limit = 1 << self.sign_bit
            if abs(value) >= limit:
                raise OverflowError(f"{value} needs more than {self.sign_bit} bits.")
            value = limit - value if value < 0 else value
        return value.to_bytes(self.size, "little", signed=self.complement)

    def decoded(self, data: bytes) -> int:
        """Return the value of ``data``."""
        value = int.from_bytes(data, "little", signed=self.complement)
        if self.sign_bit is None or not value >> self.sign_bit & 1:
            return value
        return -(value & ((1 << self.sign_bit) - 1))

    def in_block(self, data: bytes, start: int) -> int:
        """Return its value in the bytes ``data`` of a memory from the address ``start`` on."""
        return self.decoded(data[self.address - start :][: self.size])


@dataclass(frozen=True)
class Packet:
    """A packet, without what frames it.

    Attributes:
        id: number of the motor, or BROADCAST.
        code: instruction of the host, or what a motor reports.
        parameters: the rest of its content.
        status: whether a motor has sent it, if that can be seen.
    """

    id: int
    code: int
    parameters: bytes = b""
    status: bool = False


@dataclass(frozen=True)
class Framing:
    """The bytes of packets: header, id, length, code, parameters and check value.

    Attributes:
        header: first bytes of a packet.
        word: number of bytes of length and check value, and of an address in a request.
        check: returns the check value of the bytes before it.
        stuffed: bytes of which the last one is repeated in a packet; empty for none.
        status: first byte of the content of a packet that a motor has sent; None without one.
    """

    header: bytes
    word: int
    check: Callable[[bytes], int]
    stuffed: bytes = b""
    status: int | None = None

    @property
    def head_bytes(self) -> int:
        """Number of bytes before the content."""
        return len(self.header) + 1 + self.word

    def encoded(self, packet: Packet) -> bytes:
        """Return the bytes of ``packet``."""
        content = bytes((packet.code,)) + packet.parameters
        if packet.status and self.status is not None:
            content = bytes((self.status,)) + content
        if self.stuffed:
            content = content.replace(self.stuffed, self.stuffed + self.stuffed[-1:])
        head = self.header + bytes((packet.id,)) + self.words(len(content) + self.word)
        return head + content + self.words(self.check(head + content))

    def size(self, data: bytearray, place: int) -> int:
        """Return the size of the packet with the header at ``place``; 0 if none begins there."""
        motor = data[place + len(self.header)]
        length = int.from_bytes(data[place + self.head_bytes - self.word :][: self.word], "little")
        right = motor <= BROADCAST and self.word < length <= MAX_LENGTH
        return self.head_bytes + length if right else 0

    def decoded(self, data: bytes) -> Packet | None:
        """Return the packet of ``data``; None if its check value is wrong."""
        content, value = data[self.head_bytes : -self.word], data[-self.word :]
        if int.from_bytes(value, "little") != self.check(data[: -self.word]):
            return None
        if self.stuffed:
            content = content.replace(self.stuffed + self.stuffed[-1:], self.stuffed)
        status = len(content) > 1 and content[0] == self.status
        content = content[status:]
        return Packet(data[len(self.header)], content[0], content[1:], status)

    def words(self, *values: int) -> bytes:
        """Return addresses or sizes as in a request."""
        return b"".join(value.to_bytes(self.word, "little") for value in values)


@dataclass(frozen=True)
class ServoMake:
    """The servos of one maker: the framing of their packets, their registers and units.

    Attributes:
        modes: operating modes in which a motor holds a position.
        drive_mode: None if only the calibration knows the drive mode, and positions ignore it.
        counts_turns: whether a position continues beyond one turn.
        units: of position, speed, load, voltage and temperature: ticks, ticks/s, fraction of the
            torque, V, degrees C.
        settings, jaw_settings: values that are written before a motor of a joint, and that of a
            jaw, holds.
        force_limit, full_force: register of the largest force, and its value for all force.
        errors: names of the errors by their bits.
        hardware_error: register of these bits; None if each answer has them.
        alert, refusal: bits of an answer that tell that there are errors, and why a request is
            refused; 0 without them.
    """

    framing: Framing
    firmware: Register
    model: Register
    id: Register
    drive_mode: Register | None
    mode: Register
    homing_offset: Register
    min_position: Register
    max_position: Register
    torque_enable: Register
    goal_position: Register
    position: Register
    speed: Register
    load: Register
    voltage: Register
    temperature: Register
    units: tuple[float, float, float, float, float]
    modes: tuple[int, ...]
    counts_turns: bool
    settings: tuple[tuple[Register, int], ...]
    jaw_settings: tuple[tuple[Register, int], ...]
    force_limit: Register
    full_force: int
    errors: Mapping[int, str]
    hardware_error: Register | None = None
    alert: int = 0
    refusal: int = 0

    @property
    def measured(self) -> tuple[Register, ...]:
        """The registers of a reading, in the order of the units."""
        return self.position, self.speed, self.load, self.voltage, self.temperature

    def error_names(self, errors: int) -> list[str]:
        """Return the names of the bits ``errors``."""
        return [name for bit, name in self.errors.items() if errors & bit]


class PacketReader:
    """Finds packets in a stream of bytes, however it is split, and skips all other bytes."""

    def __init__(self, framing: Framing) -> None:
        self._framing = framing
        self._rest = bytearray()

    def clear(self) -> None:
        """Forget the start of a packet that has not ended."""
        self._rest.clear()

    def feed(self, data: bytes) -> list[Packet]:
        """Return the packets that ``data`` completes."""
        self._rest += data
        framing, packets, place, rest = self._framing, [], 0, self._rest
        header, least = framing.header, framing.head_bytes + framing.word + 1
        while (place := rest.find(header, place)) >= 0 and len(rest) - place >= least:
            if size := framing.size(rest, place):
                if place + size > len(rest):
                    break
                packet = framing.decoded(bytes(rest[place : place + size]))
                if packet is not None:
                    packets.append(packet)
                    place += size
                    continue
            # The header may be part of garbage.
            place += 1
        # The last bytes may begin a header.
        del rest[: place if place >= 0 else max(len(rest) - len(header) + 1, 0)]
        return packets
