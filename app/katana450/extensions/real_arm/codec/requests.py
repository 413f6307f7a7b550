"""Requests of the host. Each names the class of its reply."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Any, ClassVar, NamedTuple, Self

from katana450.errors import InputError
from katana450.extensions.real_arm.codec import replies
from katana450.extensions.real_arm.codec.replies import AXES, ArmReply, WireMessage

ALL_AXES = 0
"""Number that stands for all axes in a motor command."""

SENSOR_CONTROLLER = 15
"""Number of the controller with the sensors of the gripper."""


class MotorFlag(IntEnum):
    """Orders to the motor of an axis."""

    OFF = 0
    CALIBRATE = 4
    FREEZE = 8
    MOVE = 24
    FLUSH = 32


class ArmRequest(WireMessage, frozen=True):
    """Base of all requests."""

    REPLY: ClassVar[type[ArmReply]] = ArmReply

    def is_confirmed_by(self, reply: ArmReply) -> bool:
        """Return False if ``reply`` says that the request failed: it names axis 0."""
        return getattr(reply, "axis", 1) != 0


class ReadMasterVersion(ArmRequest, frozen=True):
    """Read the version of the master's firmware."""

    HEAD = b"B"
    REPLY = replies.MasterVersion


class ReadArmIdentity(ArmRequest, frozen=True):
    """Read the text with which the arm identifies itself."""

    HEAD = b"Y"
    REPLY = replies.ArmIdentity


class ReadSlaveVersion(ArmRequest, frozen=True):
    """Read the version of the firmware of an axis. ``parameter`` is always 32."""

    HEAD = b"V"
    LAYOUT = struct.Struct(">BB")
    REPLY = replies.SlaveVersion
    axis: int
    parameter: int = 32


class ReadAxis(ArmRequest, frozen=True):
    """Read status, position, speed and drive of an axis."""

    HEAD = b"D"
    LAYOUT = struct.Struct(">B")
    REPLY = replies.AxisReading
    axis: int


class ReadStates(ArmRequest, frozen=True):
    """Read the status of all axes."""

    HEAD = b"N\x01"
    LAYOUT = struct.Struct(">x")
    REPLY = replies.AxisStates


class ReadPositions(ArmRequest, frozen=True):
    """Read the positions of all axes."""

    HEAD = b"N\x03"
    LAYOUT = struct.Struct(">x")
    REPLY = replies.AxisPositions


class CommandMotor(ArmRequest, frozen=True):
    """Order to the motor of one axis or, with axis 0, of all.

    Attributes:
        axis: 1 to 6, or ALL_AXES.
        flag: A ``MotorFlag``.
        value: Target or position [encoders]; 32000 for a calibration.
    """

    HEAD = b"C"
    LAYOUT = struct.Struct(">BBh")
    REPLY = replies.MotorCommanded
    axis: int
    flag: int
    value: int

    def is_confirmed_by(self, reply: ArmReply) -> bool:
        """Return False if ``reply`` says that the request failed."""
        return self.axis == ALL_AXES or super().is_confirmed_by(reply)


class SetAxisParameter(ArmRequest, frozen=True):
    """Set a parameter of an axis.

    Attributes:
        axis: 1 to 6.
        parameter: 3 speed limits, 4 acceleration, 10 current limits [%], ...
        p1, p2, p3: Values, 0 without a meaning.
    """

    HEAD = b"S"
    LAYOUT = struct.Struct(">5B")
    REPLY = replies.AxisParameters
    axis: int
    parameter: int
    p1: int
    p2: int
    p3: int = 0


class SetCollisionDetection(ArmRequest, frozen=True):
    """Switch collision detection on (1) or off (0)."""

    HEAD = b"A"
    LAYOUT = struct.Struct(">xB")
    REPLY = replies.CollisionDetectionSet
    enabled: int


class ReadSensors(ArmRequest, frozen=True):
    """Read the 16 sensors of the gripper."""

    HEAD = b"E"
    LAYOUT = struct.Struct(">B")
    REPLY = replies.SensorBytes
    controller: int = SENSOR_CONTROLLER

    def is_confirmed_by(self, reply: ArmReply) -> bool:
        """Return False if ``reply`` says that the request failed."""
        return isinstance(reply, replies.SensorBytes) and reply.controller != 0


class AxisSegment(NamedTuple):
    """One polynomial of one axis: p(t) = p0 + p1/64 t + p2/1024 t^2 + p3/32768 t^3.

    Attributes:
        ticks: Length T in ticks of 10 ms.
        target: Position at its end [encoders].
        p0, p1, p2, p3: Coefficients as sent.
    """

    ticks: int
    target: int
    p0: int
    p1: int
    p2: int
    p3: int

    def at(self, tick: float) -> float:
        """Return the position [encoders] at ``tick``."""
        return self.p0 + tick * (self.p1 / 64 + tick * (self.p2 / 1024 + tick * self.p3 / 32768))

    def speed_at(self, tick: float) -> float:
        """Return the speed [encoders per tick] at ``tick``."""
        return self.p1 / 64 + tick * (self.p2 / 512 + tick * 3 * self.p3 / 32768)


class More(IntEnum):
    """Position of a packet of polynomials in a motion."""

    START = 0
    """The motion starts or continues, and further packets follow."""
    LAST = 1
    """The motion starts or continues, and this is its end."""
    STORE = 2
    """The packet waits for a later one."""


class SendSplines(ArmRequest, frozen=True):
    """Polynomials of all axes, in one packet.

    Attributes:
        segments: (6,) One for each axis. That of the gripper never moved it on real arms.
        more: A value of ``More``.
        exact: 1: the position is controlled after the motion.
    """

    HEAD = b"H"
    LAYOUT = struct.Struct(">36h2B")
    REPLY = replies.SplinesSent
    segments: tuple[AxisSegment, ...]
    more: int
    exact: int = 1

    def _numbers(self) -> list[Any]:
        return [*(number for segment in self.segments for number in segment), self.more, self.exact]

    @classmethod
    def _of(cls, numbers: tuple[Any, ...]) -> Self:
        width = len(AxisSegment._fields)
        starts = range(0, AXES * width, width)
        segments = tuple(AxisSegment(*numbers[i : i + width]) for i in starts)
        return cls(segments, *numbers[AXES * width :])


class ErrorQuery(ArmRequest, frozen=True):
    """Fetch the reason of an error. Sent as four raw bytes without header and checksum."""

    HEAD = b"\x00\x00\x00\xc1"
    REPLY = replies.FirmwareError


REQUESTS = tuple(kind for kind in ArmRequest.__subclasses__() if kind is not ErrorQuery)
"""Requests that are sent in frames: all but ``ErrorQuery``."""


def read_request(payload: bytes) -> ArmRequest:
    """Return the request in the payload of a frame. Raises InputError if there is none."""
    known = [request for request in REQUESTS if payload.startswith(request.HEAD)]
    if not known:
        raise InputError(f"No request begins with {payload[:2].hex(' ') or 'nothing'}.")
    return known[0].read(payload)
