"""Replies of the arm. Bytes whose meaning is not known are kept as they are."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import ClassVar, Self

from katana450.errors import InputError
from katana450.extensions.real_arm.codec.error_codes import error_sentence
from katana450.extensions.real_arm.codec.wire_message import WireMessage

AXES = 6
"""Axes of the protocol: five of the arm, and the gripper."""

ERROR_FLAG = b"\xc0"
"""Payload that answers any request which the arm refuses; its reason is fetched by ErrorQuery."""

ERROR_TEXT_LENGTH = 51
"""Bytes of the text of an error in the longest form, with its final zero."""


@dataclass(frozen=True)
class ArmReply(WireMessage):
    """Base of all replies."""


@dataclass(frozen=True)
class EchoReply(ArmReply):
    """Reply without content."""

    HEAD = b"z"


@dataclass(frozen=True)
class MasterVersion(ArmReply):
    """Firmware of the master, 2.1 for example."""

    HEAD = b"b"
    LAYOUT = struct.Struct(">BB")
    version: int
    revision: int


@dataclass(frozen=True)
class ArmIdentity(ArmReply):
    """Text of 81 bytes with which the arm identifies itself, and its end of line."""

    HEAD = b"y"
    LAYOUT = struct.Struct(">81s2s")
    text: bytes
    end: bytes = b"\r\n"


@dataclass(frozen=True)
class CommandTable(ArmReply):
    """Commands of the firmware: 30 entries of 6 bytes.

    An entry holds index, command, three bytes of unknown meaning, and the letter of the reply.
    """

    HEAD = b"x"
    LAYOUT = struct.Struct(">180s")
    entries: bytes


@dataclass(frozen=True)
class SlaveVersion(ArmReply):
    """Firmware of the controller of an axis.

    Attributes:
        axis: Axis; 0 for a failure.
        parameter: Unknown; 32 as in the request.
        version, subversion, revision: Version.
        controller: 0 for a controller of drive and position, 1 for one of the current.
        subtype: Unknown.
        rest: Five bytes of unknown meaning.
    """

    HEAD = b"v"
    LAYOUT = struct.Struct(">7B5s")
    axis: int
    parameter: int
    version: int
    subversion: int
    revision: int
    controller: int
    subtype: int
    rest: bytes = b"\0\0\0\0\0"


@dataclass(frozen=True)
class AxisReading(ArmReply):
    """State of one axis.

    Attributes:
        axis: Axis; 0 for a failure.
        status: Status byte; see ``axis_status``.
        position: [encoders].
        velocity: [encoders per 10 ms]; of doubtful sign and scale on real arms.
        pwm: Drive of the motor, in an unknown unit.
    """

    HEAD = b"d"
    LAYOUT = struct.Struct(">BBhhB")
    axis: int
    status: int
    position: int
    velocity: int
    pwm: int


@dataclass(frozen=True)
class AxisStates(ArmReply):
    """Status bytes of all axes, (6,)."""

    HEAD = b"n"
    LAYOUT = struct.Struct(">6B6x")
    states: tuple[int, ...]


@dataclass(frozen=True)
class AxisPositions(ArmReply):
    """Positions of all axes, (6,) [encoders]."""

    HEAD = b"n"
    LAYOUT = struct.Struct(">6h")
    positions: tuple[int, ...]


@dataclass(frozen=True)
class MotorCommanded(ArmReply):
    """Answer to a motor command. ``axis``: 0 for a failure, unless the command was for all."""

    HEAD = b"c"
    LAYOUT = struct.Struct(">BB")
    axis: int
    flag: int


@dataclass(frozen=True)
class AxisParameters(ArmReply):
    """Values of a parameter of an axis."""

    HEAD = b"s"
    LAYOUT = struct.Struct(">5B")
    axis: int
    parameter: int
    r1: int
    r2: int
    r3: int


@dataclass(frozen=True)
class CollisionDetectionSet(ArmReply):
    """Answer to switching collision detection. ``result``: unknown; 0."""

    HEAD = b"a"
    LAYOUT = struct.Struct(">B")
    result: int = 0


@dataclass(frozen=True)
class SensorBytes(ArmReply):
    """Sensors of the gripper, (16,) as raw bytes. ``controller``: 0 for a failure."""

    HEAD = b"e"
    LAYOUT = struct.Struct(">B16B")
    controller: int
    values: tuple[int, ...]


@dataclass(frozen=True)
class SplinesSent(ArmReply):
    """Answer to the polynomials of all axes. ``results``: two bytes of unknown meaning."""

    HEAD = b"h"
    LAYOUT = struct.Struct(">2s")
    results: bytes = b"\x02\x01"


@dataclass(frozen=True)
class DigitalBits(ArmReply):
    """Digital inputs: input n is bit n - 1, 0 while it is active."""

    HEAD = b"t"
    LAYOUT = struct.Struct(">B")
    bits: int


@dataclass(frozen=True)
class FirmwareError(ArmReply):
    """Reason for which the arm refused a request.

    Attributes:
        command: First byte of the refused request.
        code: Number of the error, -1 to -13.
        axis: Axis, 0 for none.
        text: Words of the firmware.
    """

    HEAD = b"\xc1"
    LAYOUT = struct.Struct(">BbB")
    LONGEST: ClassVar[int] = 4 + ERROR_TEXT_LENGTH
    command: int
    code: int
    axis: int
    text: str

    @property
    def payload(self) -> bytes:
        """Bytes in the longest form: text of 50 bytes and a zero."""
        text = self.text.encode("ascii", "replace")[: ERROR_TEXT_LENGTH - 1]
        numbers = self.LAYOUT.pack(self.command, self.code, self.axis)
        return self.HEAD + numbers + text.ljust(ERROR_TEXT_LENGTH, b"\0")

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return the error in ``payload``. Raises InputError if it is none."""
        if not payload.startswith(cls.HEAD) or not cls.length() < len(payload) <= cls.LONGEST:
            raise InputError(f"{payload[:8].hex(' ')} ({len(payload)} bytes) is no error.")
        command, code, axis = cls.LAYOUT.unpack_from(payload, 1)
        text = payload[cls.length() :].partition(b"\0")[0].decode("ascii", "replace")
        return cls(command, code, axis, text)

    @property
    def sentence(self) -> str:
        """The error as a sentence for people."""
        return error_sentence(self.command, self.code, self.axis, self.text)
