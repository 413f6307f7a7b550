"""The firmware of the emulated arm: requests are executed and answered, without input or output."""

from __future__ import annotations

from katana450.extensions.real_arm.codec import replies
from katana450.extensions.real_arm.codec import requests as req
from katana450.extensions.real_arm.codec.codecs import (
    FirmwareEvent,
    RequestInvalid,
    reply_bytes,
)
from katana450.extensions.real_arm.codec.replies import (
    COLLISION_ERROR,
    CRC_ERROR,
    INVALID_ARGUMENT,
    AxisStatus,
)
from katana450.extensions.real_arm.emulator.arm import GRIPPER, EmulatedArm
from katana450.extensions.real_arm.emulator.axis import TICK, AxisMode, EmulatedAxis

VERSION = (2, 1)
"""Version of the master's firmware; clients of the maker accept 2 and 3 for this arm."""

IDENTITY = b"Katana450 6M180 emulator".ljust(81)

STATE_MISMATCH, NOT_OPERATIONAL, SPLINE_FAILED = -3, -7, -9
"""Codes of errors."""

COLLISION_AXIS = 30
"""Axis field of the error after a collision, as seen on a real arm; its text names the axis."""

PARAMETERS = 12
"""Number above those of the parameters that are set."""

NO_ERROR = replies.FirmwareError(0, -1, 0, "")

NO_FORCES = (0,) * 16
"""Bytes of the sensors of the gripper: how they behave is not known."""


class RequestError(Exception):
    """A request is refused, with the number of the error, the axis and the words."""

    def __init__(self, code: int, axis: int, text: str) -> None:
        super().__init__(text)
        self.code, self.axis, self.text = code, axis, text


class Firmware:
    """Answers requests for an arm.

    Attributes:
        arm: the arm.
    """

    def __init__(self, arm: EmulatedArm) -> None:
        self.arm = arm
        self._error = NO_ERROR

    def handle(self, event: FirmwareEvent) -> bytes:
        """Execute what was received and return the bytes of the answer."""
        if isinstance(event, RequestInvalid):
            crc_is_wrong = event.code == CRC_ERROR
            text = "CRC error" if crc_is_wrong else "unknown command or wrong length"
            return self._refuse(event.payload, RequestError(event.code, 0, text))
        try:
            return reply_bytes(self.answer(event))
        except RequestError as refusal:
            return self._refuse(event.payload, refusal)

    def answer(self, request: req.ArmRequest) -> replies.ArmReply:
        """Execute ``request`` and return its reply. Raises RequestError."""
        arm = self.arm
        match request:
            case req.ErrorQuery():
                return self._error
            case req.ReadAxis(axis):
                return self._reading(axis)
            case req.ReadStates():
                return replies.AxisStates(tuple(axis.reported_status for axis in arm.axes))
            case req.ReadPositions():
                return replies.AxisPositions(tuple(axis.position for axis in arm.axes))
            case req.SendSplines():
                return self._splines(request)
            case req.CommandMotor():
                return self._command(request)
            case req.SetAxisParameter():
                return self._parameter(request)
            case req.SetCollisionDetection(enabled):
                arm.detects_collisions = bool(enabled)
                return replies.CollisionDetectionSet()
            case req.ReadSensors(controller):
                return replies.SensorBytes(controller, NO_FORCES)
            case req.ReadMasterVersion():
                return replies.MasterVersion(*VERSION)
            case req.ReadArmIdentity():
                return replies.ArmIdentity(IDENTITY)
            case req.ReadSlaveVersion(axis, parameter):
                self._axis(axis)
                return replies.SlaveVersion(axis, parameter, 2, 1, 0, 0, 0)
        raise RequestError(INVALID_ARGUMENT, 0, "unknown command")

    def _refuse(self, payload: bytes, refusal: RequestError) -> bytes:
        command = payload[0] if payload else 0
        self._error = replies.FirmwareError(command, refusal.code, refusal.axis, refusal.text)
        return reply_bytes(replies.RefusedReply())

    def _axis(self, number: int) -> EmulatedAxis:
        if not 1 <= number <= len(self.arm.axes):
            raise RequestError(INVALID_ARGUMENT, 0, f"there is no axis {number}")
        return self.arm.axes[number - 1]

    def _reading(self, number: int) -> replies.AxisReading:
        axis = self._axis(number)
        # As on real arms: the sign is that of falling counts, axis 3 reads double, 5 inverted.
        factor = {3: -2.0, 5: 1.0}.get(number, -1.0)
        velocity = round(factor * axis.plant.speed * TICK)
        return replies.AxisReading(number, axis.reported_status, axis.position, velocity, axis.pwm)

    def _check_ready(self, axis: int) -> None:
        """Raise RequestError unless the arm accepts a motion of ``axis``; 0 stands for all."""
        arm = self.arm
        if arm.is_calibrating:
            raise RequestError(STATE_MISMATCH, axis, "calibration is running")
        if not all(joint.is_calibrated for joint in arm.chosen(axis)):
            raise RequestError(STATE_MISMATCH, axis, "axis is not calibrated")
        if arm.collided:
            text = f"StopperThread: collision on axis: {arm.collided}"
            raise RequestError(COLLISION_ERROR, COLLISION_AXIS, text)

    def _command(self, request: req.CommandMotor) -> replies.MotorCommanded:
        arm, number, flag = self.arm, request.axis, request.flag
        if number != req.ALL_AXES:
            self._axis(number)
        match flag:
            case req.MotorFlag.OFF:
                arm.end_calibration()
                for axis in arm.chosen(number):
                    axis.turn_off()
            case req.MotorFlag.CALIBRATE:
                if not arm.is_calibrating:
                    arm.calibrate(number)
            case req.MotorFlag.FREEZE:
                arm.freeze(number)
            case req.MotorFlag.MOVE:
                self._check_ready(number)
                for axis in arm.chosen(number):
                    axis.move_to(request.value)
            case req.MotorFlag.FLUSH:
                for axis in arm.chosen(number):
                    axis.splines.flush()
            case _:
                raise RequestError(INVALID_ARGUMENT, number, f"unknown motor command {flag}")
        arm.touch()
        return replies.MotorCommanded(number, flag)

    def _parameter(self, request: req.SetAxisParameter) -> replies.AxisParameters:
        axis, number = self._axis(request.axis), request.parameter
        values = (request.p1, request.p2, request.p3)
        if not 0 < number < PARAMETERS:
            raise RequestError(INVALID_ARGUMENT, request.axis, f"unknown parameter {number}")
        axis.parameters[number] = values
        return replies.AxisParameters(request.axis, number, *values)

    def _splines(self, request: req.SendSplines) -> replies.SplinesSent:
        arm = self.arm
        if request.more not in (req.More.START, req.More.LAST, req.More.STORE):
            raise RequestError(INVALID_ARGUMENT, 0, f"more must be 0, 1 or 2, not {request.more}")
        segments = request.segments[:GRIPPER]
        # All axes can take theirs, or none gets anything.
        axes = [self._free_axis(number, piece) for number, piece in enumerate(segments, 1)]
        for axis, segment in zip(axes, segments, strict=True):
            axis.splines.store(segment, request.more)
        if request.more != req.More.STORE:
            for axis in arm.axes[:GRIPPER]:
                axis.start_splines(request.more)
            arm.touch()
            # A client that waits for all axes would wait for a gripper that does not follow.
            if arm.axes[GRIPPER].status == AxisStatus.FIXED:
                arm.axes[GRIPPER].status = AxisStatus.SPLINES_DONE
        return replies.SplinesSent()

    def _free_axis(self, number: int, segment: req.AxisSegment) -> EmulatedAxis:
        """Return the axis ``number``. Raises RequestError if it cannot take ``segment`` now."""
        axis = self._axis(number)
        self._check_ready(number)
        if segment.ticks < 0:
            raise RequestError(INVALID_ARGUMENT, number, "time is negative")
        if axis.mode is AxisMode.OFF or axis.status == AxisStatus.COLLIDED:
            raise RequestError(NOT_OPERATIONAL, number, "axis does not hold")
        if axis.splines.is_full:
            raise RequestError(SPLINE_FAILED, number, "move buffer error")
        return axis
