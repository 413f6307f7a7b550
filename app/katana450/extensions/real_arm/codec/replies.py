"""Messages as typed values, and the replies of the arm with their numbers in words.

Bytes whose meaning is not known are kept as they are.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from enum import IntEnum
from typing import Any, ClassVar, Final, Self

import msgspec

from katana450.errors import InputError


class WireMessage(msgspec.Struct, frozen=True):
    """A message: fixed bytes, then the fields of the class in the order of their definition.

    Attributes:
        HEAD: Bytes with which the payload begins: the letter of the command, and for some commands
            a second byte that chooses among several layouts.
        LAYOUT: Fields after it, as ``struct`` counts them, big endian. A field that is a tuple is
            the last one and holds all remaining numbers.
    """

    HEAD: ClassVar[bytes] = b""
    LAYOUT: ClassVar[struct.Struct] = struct.Struct(">")

    @classmethod
    def length(cls) -> int:
        """Return the number of bytes of the payload."""
        return len(cls.HEAD) + cls.LAYOUT.size

    @property
    def payload(self) -> bytes:
        """Bytes without header and checksum. Raises InputError for numbers that do not fit."""
        try:
            return self.HEAD + self.LAYOUT.pack(*self._numbers())
        except struct.error as error:
            raise InputError(f"{self} does not fit into its message: {error}.") from None

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return the message in ``payload``. Raises InputError for another head or length."""
        if not payload.startswith(cls.HEAD) or len(payload) != cls.length():
            raise InputError(
                f"{payload[:8].hex(' ')} ({len(payload)} bytes) is no {cls.__name__}: that begins "
                f"with {cls.HEAD.hex(' ')} and has {cls.length()} bytes."
            )
        return cls._of(cls.LAYOUT.unpack_from(payload, len(cls.HEAD)))

    def _numbers(self) -> list[Any]:
        numbers: list[Any] = []
        for value in msgspec.structs.astuple(self):
            numbers += value if isinstance(value, tuple) else (value,)
        return numbers

    @classmethod
    def _of(cls, numbers: tuple[Any, ...]) -> Self:
        create: Callable[..., Self] = cls
        count = len(cls.__struct_fields__)
        if len(numbers) == count:
            return create(*numbers)
        return create(*numbers[: count - 1], numbers[count - 1 :])


class AxisStatus(IntEnum):
    """Known values of the status byte of an axis. Others occur and have no known meaning."""

    OFF = 0
    CALIBRATING = 4
    FIXED = 8
    MOVING = 16
    MOVING_TO_TARGET = 24
    COLLIDED = 40
    SPLINES_DONE = 88
    DATA_INVALID = 128
    SPLINE_BUFFER_FULL = 152


IN_MOTION = frozenset(
    (AxisStatus.MOVING, AxisStatus.MOVING_TO_TARGET, AxisStatus.SPLINE_BUFFER_FULL)
)
"""Values of an axis that moves by itself."""

AT_REST = frozenset((AxisStatus.FIXED, AxisStatus.SPLINES_DONE))
"""Values of an axis that holds its position and accepts a motion."""

STATUS_WORDS = {
    AxisStatus.OFF: "its motor is off",
    AxisStatus.CALIBRATING: "it calibrates",
    AxisStatus.FIXED: "it holds its position",
    AxisStatus.MOVING: "it moves",
    AxisStatus.MOVING_TO_TARGET: "it moves to a target",
    AxisStatus.COLLIDED: "a collision stopped it",
    AxisStatus.SPLINES_DONE: "its motion is finished",
    AxisStatus.DATA_INVALID: "its data are invalid",
    AxisStatus.SPLINE_BUFFER_FULL: "it moves and its buffer is full",
}


def status_words(status: int) -> str:
    """Return a status byte in words, as the end of a sentence on the axis."""
    if status in STATUS_WORDS:
        return STATUS_WORDS[AxisStatus(status)]
    return f"it reports the unknown status {status}"


CRC_ERROR: Final = -12
"""Code for a request whose checksum is wrong. Real arms may answer otherwise: not known."""

INVALID_ARGUMENT: Final = -2
"""Code for a request with a command, a length or a value that the firmware does not know."""

COLLISION_ERROR: Final = -10
"""Code for a collision."""

CAUSES = {
    -1: "it failed",
    INVALID_ARGUMENT: "an argument is invalid",
    -3: "the arm is not in the right state",
    -4: "the type is wrong",
    -5: "a value is out of range",
    -6: "the axis sends no heartbeat",
    -7: "the axis is not operational",
    -8: "the axis cannot move",
    -9: "the axis cannot follow its polynomial",
    COLLISION_ERROR: "the axis collided",
    -11: "an axis failed",
    CRC_ERROR: "the checksum of the request was wrong",
    -13: "a peripheral failed",
}

COMMANDS = {
    "A": "collision detection",
    "B": "master firmware",
    "C": "motor command",
    "D": "axis state",
    "E": "sensors",
    "H": "polynomials",
    "N": "states or positions",
    "S": "axis parameter",
    "V": "slave firmware",
    "Y": "identity",
}


def error_sentence(command: int, code: int, axis: int, text: str) -> str:
    """Return a firmware error as a sentence for people.

    Args:
        command: First byte of the refused request.
        code: Number of the error.
        axis: Axis as the firmware counts, 0 for none. Real arms also send numbers above 6.
        text: Words of the firmware, which may be empty.
    """
    name = COMMANDS.get(chr(command), f"0x{command:02X}")
    where = f", axis {axis}" if 1 <= axis <= 6 else ""
    cause = CAUSES.get(code, f"error {code}")
    words = f" ({text!r})" if text else ""
    return f"The arm refused a request ({name}{where}): {cause}{words}."


AXES = 6
"""Axes of the protocol: five of the arm, and the gripper."""

ERROR_TEXT_LENGTH = 51
"""Bytes of the text of an error in the longest form, with its final zero."""


class ArmReply(WireMessage, frozen=True):
    """Base of all replies."""


class RefusedReply(ArmReply, frozen=True):
    """Answer to any request that the arm refuses; its reason is fetched by ErrorQuery."""

    HEAD = b"\xc0"


class MasterVersion(ArmReply, frozen=True):
    """Firmware of the master, 2.1 for example."""

    HEAD = b"b"
    LAYOUT = struct.Struct(">BB")
    version: int
    revision: int


class ArmIdentity(ArmReply, frozen=True):
    """Text of 81 bytes with which the arm identifies itself, and its end of line."""

    HEAD = b"y"
    LAYOUT = struct.Struct(">81s2s")
    text: bytes
    end: bytes = b"\r\n"


class SlaveVersion(ArmReply, frozen=True):
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


class AxisReading(ArmReply, frozen=True):
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


class AxisStates(ArmReply, frozen=True):
    """Status bytes of all axes, (6,)."""

    HEAD = b"n"
    LAYOUT = struct.Struct(">6B6x")
    states: tuple[int, ...]


class AxisPositions(ArmReply, frozen=True):
    """Positions of all axes, (6,) [encoders]."""

    HEAD = b"n"
    LAYOUT = struct.Struct(">6h")
    positions: tuple[int, ...]


class MotorCommanded(ArmReply, frozen=True):
    """Answer to a motor command. ``axis``: 0 for a failure, unless the command was for all."""

    HEAD = b"c"
    LAYOUT = struct.Struct(">BB")
    axis: int
    flag: int


class AxisParameters(ArmReply, frozen=True):
    """Values of a parameter of an axis."""

    HEAD = b"s"
    LAYOUT = struct.Struct(">5B")
    axis: int
    parameter: int
    r1: int
    r2: int
    r3: int


class CollisionDetectionSet(ArmReply, frozen=True):
    """Answer to switching collision detection. ``result``: unknown; 0."""

    HEAD = b"a"
    LAYOUT = struct.Struct(">B")
    result: int = 0


class SensorBytes(ArmReply, frozen=True):
    """Sensors of the gripper, (16,) as raw bytes. ``controller``: 0 for a failure."""

    HEAD = b"e"
    LAYOUT = struct.Struct(">B16B")
    controller: int
    values: tuple[int, ...]


class SplinesSent(ArmReply, frozen=True):
    """Answer to the polynomials of all axes. ``results``: two bytes of unknown meaning."""

    HEAD = b"h"
    LAYOUT = struct.Struct(">2s")
    results: bytes = b"\x02\x01"


class FirmwareError(ArmReply, frozen=True):
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
