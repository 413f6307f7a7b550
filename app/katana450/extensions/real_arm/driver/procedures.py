"""Newest measurements of an arm, and sequences of requests to it.

A sequence is a generator that yields requests and pauses, and ends in a mode. A reply is in
``ArmReadings`` when its generator continues. A refusal is raised in it as ArmRefusalError. Nothing
here knows a connection, a clock or a thread.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.state.arm_report import ArmMode, MeasuredStop
from katana450.extensions.real_arm.codec.replies import (
    AT_REST,
    AXES,
    IN_MOTION,
    ArmReply,
    AxisPositions,
    AxisReading,
    AxisStates,
    AxisStatus,
    MasterVersion,
    SensorBytes,
    status_words,
)
from katana450.extensions.real_arm.codec.requests import (
    ALL_AXES,
    ArmRequest,
    CommandMotor,
    MotorFlag,
    ReadArmIdentity,
    ReadAxis,
    ReadMasterVersion,
    ReadPositions,
    ReadSlaveVersion,
    ReadStates,
    SetAxisParameter,
    SetCollisionDetection,
)
from katana450.extensions.real_arm.encoder_map import DRIVEN, MAX_SPEED, EncoderMap
from katana450.extensions.real_arm.link import ArmRefusalError
from katana450.extensions.real_arm.tool_travel import Travel
from katana450.maths.geometry.arrays import FloatArray, IntArray

SHORTEST_INTERVAL = 0.02
"""[s] Time between two positions below which their difference gives no useful speed."""


class ArmReadings:
    """Newest measurements of an arm, and the positions at which it was ordered to hold.

    Attributes:
        positions: (6,) [encoders].
        t: Time of the positions [s]; -inf before the first ones.
        speeds: (6,) [encoders/s], from differences of positions: the arm's own are doubtful.
        states: (6,) status bytes; 255 before the first ones.
        states_t: Time of the states [s]; -inf before the first ones.
        sensors: (16,) raw sensors of the gripper; empty before the first ones.
        newest_reply: Time of the newest reply [s].
        version: Firmware of the master, such as 2.1; empty before it is known.
        held: (6,) positions at which the axes were ordered to hold, or ended a motion [encoders].
    """

    def __init__(self) -> None:
        self.positions: IntArray = np.zeros(AXES, np.int64)
        self.t = self.states_t = self.newest_reply = -math.inf
        self.speeds: FloatArray = np.zeros(AXES)
        self.states: tuple[int, ...] = (255,) * AXES
        self.sensors: tuple[int, ...] = ()
        self.version = ""
        self.held: IntArray = np.zeros(AXES, np.int64)

    def note(self, reply: ArmReply, t: float) -> None:
        """Take the measurement in ``reply``, if it has one, made at ``t`` [s]."""
        self.newest_reply = t
        match reply:
            case AxisPositions():
                self._move(np.array(reply.positions, np.int64), t)
            case AxisStates():
                self.states, self.states_t = reply.states, t
            case AxisReading(axis=axis, status=status, position=position) if axis <= AXES:
                self.positions = self.positions.copy()
                self.positions[axis - 1] = position
                self.states = (*self.states[: axis - 1], status, *self.states[axis:])
                self.t = self.states_t = t
            case SensorBytes(values=values):
                self.sensors = values
            case MasterVersion(version=version, revision=revision):
                self.version = f"{version}.{revision}"
            case _:
                pass

    def _move(self, positions: IntArray, t: float) -> None:
        dt = t - self.t
        if dt >= SHORTEST_INTERVAL:
            self.speeds = (positions - self.positions) / dt
        self.positions, self.t = positions, t

    def position_at(self, t: float) -> FloatArray:
        """Return the positions (6,) [encoders] expected at ``t`` [s] from the newest ones."""
        return self.positions + self.speeds * (t - self.t if math.isfinite(self.t) else 0.0)

    def axes_in(self, *statuses: int) -> tuple[int, ...]:
        """Return the axes, from 1, whose status is one of ``statuses``."""
        return tuple(i for i, status in enumerate(self.states, 1) if status in statuses)

    @property
    def collided(self) -> tuple[int, ...]:
        """Axes, from 1, that a collision stopped."""
        return self.axes_in(AxisStatus.COLLIDED)

    def words(self, axis: int) -> str:
        """Return the status of ``axis``, from 1, as a sentence."""
        return f"Axis {axis}: {status_words(self.states[axis - 1])}."


def collision_sentence(axes: tuple[int, ...]) -> str:
    """Return the sentence about a collision of ``axes``, of which there is at least one."""
    *others, last = map(str, axes)
    names = f"axes {', '.join(others)} and {last}" if others else f"axis {last}"
    return f"A collision stopped {names}. Clear the space around the arm, then unblock it."


CALIBRATION_VALUE = 32_000
"""Value that the order to calibrate carries."""

CALIBRATION_TIMEOUT = 120.0
"""[s] Maximum time of a calibration, which takes about 30 s."""

CALIBRATION_PAUSE = 0.1
"""[s] Time between two questions during a calibration."""

SPEED_LIMIT, ACCELERATION_LIMIT = 3, 4
"""Parameters of an axis."""

FINGER_ACCELERATION = 2
"""[encoders per tick^2] The higher of the two accelerations that the firmware knows."""

READY_TRIES, READY_PAUSE = 10, 0.1
"""Questions whether the motors hold the arm, and the time between two of them [s]."""

FRESH = 0.1
"""[s] Age of positions up to which an axis is frozen at them."""

STILL = 2
"""[encoders] Maximum difference between two positions of an arm at rest."""

REST_PAUSE = 0.02
"""[s] Time between two positions of an arm that comes to rest."""

REST_TIMEOUT = 3.0
"""[s] Time after which an arm that still moves does not obey."""


@dataclass(frozen=True)
class ProcedureEnd:
    """End of a procedure.

    Attributes:
        mode: Mode of the arm after it.
        note: Sentence for people; empty if there is nothing to say.
        measured_stop: The stop that the procedure performed, if it did.
    """

    mode: ArmMode
    note: str = ""
    measured_stop: MeasuredStop | None = None


Procedure = Generator[ArmRequest | float, None, ProcedureEnd]
"""Yields requests, and pauses [s]."""

_Part = Generator[ArmRequest | float, None, None]


def identify(arm: ArmReadings, sentence: str) -> Procedure:
    """Read what the arm is and where it is. An arm that moves is stopped.

    sentence: Sentence with which the note begins.
    """
    yield ReadMasterVersion()
    yield ReadArmIdentity()
    for axis in DRIVEN:
        yield ReadSlaveVersion(axis)
    yield ReadPositions()
    yield ReadStates()
    arm.held = arm.positions
    moving = arm.axes_in(*IN_MOTION)
    if moving:
        yield from _flush()
        yield from _freeze(arm, moving)
        sentence += " The arm moved and was stopped."
    if arm.axes_in(AxisStatus.CALIBRATING):
        sentence += " The arm is calibrating: wait until it has ended."
    if arm.collided:
        sentence += f" {collision_sentence(arm.collided)}"
    return ProcedureEnd(
        ArmMode.UNCALIBRATED,
        f"{sentence} Firmware {arm.version}. If the arm was calibrated since it was switched on, "
        "engage it; otherwise calibrate it.",
    )


def hold(arm: ArmReadings) -> Procedure:
    """Let the motors hold the arm where it is, also after a collision or an error."""
    yield from _flush()
    yield ReadPositions()
    yield from _freeze(arm, DRIVEN)
    return (yield from _ready(arm))


def calibrate(arm: ArmReadings) -> Procedure:
    """Let the arm move to its stops and find its encoders, without detection of collisions."""
    yield SetCollisionDetection(0)
    try:
        yield from _flush()
        yield CommandMotor(ALL_AXES, MotorFlag.CALIBRATE, CALIBRATION_VALUE)
    except ArmRefusalError:
        yield SetCollisionDetection(1)
        raise
    return (yield from _calibrated(arm))


def _calibrated(arm: ArmReadings) -> Procedure:
    """Wait for the end of a calibration. Only single axes are asked for, as is known to work."""
    start = arm.newest_reply
    while arm.newest_reply - start < CALIBRATION_TIMEOUT:
        yield CALIBRATION_PAUSE
        for axis in reversed(DRIVEN):
            # The first axis is known to answer meanwhile, and ends last.
            with suppress(*(ArmRefusalError,) * (axis != 1)):
                yield ReadAxis(axis)
        if not arm.axes_in(AxisStatus.CALIBRATING):
            yield ReadPositions()
            arm.held = arm.positions
            return (yield from _ready(arm))
    return ProcedureEnd(ArmMode.FAULT, "The calibration did not end. Switch the arm off.")


def release(arm: ArmReadings) -> Procedure:
    """Switch all motors off."""
    yield from _flush()
    yield ReadPositions()
    for axis in DRIVEN:
        yield CommandMotor(axis, MotorFlag.OFF, int(arm.positions[axis - 1]))
    yield ReadStates()
    return ProcedureEnd(ArmMode.UNCALIBRATED, "Motors off: the arm is not held.")


def halt(
    arm: ArmReadings,
    axes: tuple[int, ...],
    encoders: EncoderMap,
    start: float,
    cause: str = "",
    travel: Travel | None = None,
) -> Procedure:
    """Stop the arm as fast as its protocol allows, and measure the stop.

    The buffer of polynomials is emptied, then each axis is frozen where it is, the fastest first.
    Refusals do not end this before each axis was tried.

    Args:
        arm: Readings.
        axes: Axes to freeze, from 1.
        encoders: Conversion to joints.
        start: Time of the request to stop [s].
        cause: Sentence on the fault that the stop follows; empty for a request of a person.
        travel: Travel of the tool between two postures; None if it is not measured.
    """
    origin = arm.position_at(start)
    refusal = ""
    try:
        yield from _flush()
    except ArmRefusalError as error:
        refusal = str(error)
    if cause:
        with suppress(ArmRefusalError):
            yield ReadStates()
    yield ReadPositions()
    speeds = np.abs(arm.speeds * encoders.scale)
    order = sorted(axes, key=lambda axis: -speeds[axis - 1])
    for axis in order:
        # To freeze an axis clears its collision, which is the act of a person.
        if axis not in arm.collided:
            try:
                yield from _freeze(arm, (axis,))
            except ArmRefusalError as error:
                refusal = refusal or str(error)
    resting = yield from _rest(arm, start)
    arm.held = arm.positions
    yield ReadStates()
    moved = np.abs((arm.positions - origin) * encoders.scale)[: AXES - 1]
    stop = None
    if resting is not None:
        ends = encoders.joints(origin), encoders.joints(arm.positions)
        distance = None if travel is None else travel(*ends)
        stop = MeasuredStop(resting - start, float(moved.max()), distance)
    collided = tuple(axis for axis in arm.collided if axis < AXES)
    if collided:
        return ProcedureEnd(ArmMode.COLLIDED, collision_sentence(collided), stop)
    if resting is None:
        refusal = "The arm still moves after it was frozen. Use its switch."
    if cause or refusal:
        return ProcedureEnd(ArmMode.FAULT, refusal if resting is None else cause or refusal, stop)
    return ProcedureEnd(ArmMode.HOLDING, "", stop)


def _rest(arm: ArmReadings, start: float) -> Generator[ArmRequest | float, None, float | None]:
    """Return the time at which the arm was first seen at rest [s]; None if it continues to move."""
    while arm.t - start < REST_TIMEOUT:
        t, before = arm.t, arm.positions
        yield REST_PAUSE
        yield ReadPositions()
        if np.abs(arm.positions - before).max() <= STILL:
            return t
    return None


def _flush() -> _Part:
    yield CommandMotor(ALL_AXES, MotorFlag.FLUSH, 0)


def _freeze(arm: ArmReadings, axes: Iterable[int]) -> _Part:
    """Freeze each axis where it was measured, which is measured again if it takes long."""
    for axis in axes:
        if arm.newest_reply - arm.t > FRESH:
            yield ReadPositions()
        position = int(arm.positions[axis - 1])
        yield CommandMotor(axis, MotorFlag.FREEZE, position)
        held = arm.held.copy()
        held[axis - 1] = position
        arm.held = held


def _ready(arm: ArmReadings) -> Procedure:
    """Switch collision detection on, and check that all axes hold."""
    yield SetCollisionDetection(1)
    with suppress(ArmRefusalError):
        yield SetAxisParameter(AXES, SPEED_LIMIT, MAX_SPEED, MAX_SPEED)
        yield SetAxisParameter(AXES, ACCELERATION_LIMIT, FINGER_ACCELERATION, 0)
    for _ in range(READY_TRIES):
        yield ReadStates()
        wrong = [axis for axis in DRIVEN if axis not in arm.axes_in(*AT_REST)]
        if not wrong:
            return ProcedureEnd(ArmMode.HOLDING)
        yield READY_PAUSE
    words = " ".join(arm.words(axis) for axis in wrong)
    return ProcedureEnd(ArmMode.FAULT, f"The motors do not hold the arm. {words}")
