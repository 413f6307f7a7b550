"""Motion of arm and gripper from setpoints: what to send next, and where both should be."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from katana450.extensions.real_arm.codec.replies import AT_REST
from katana450.extensions.real_arm.codec.requests import (
    ArmRequest,
    CommandMotor,
    MotorFlag,
    SendSplines,
)
from katana450.extensions.real_arm.driver.procedures import ArmReadings
from katana450.extensions.real_arm.driver.spline_motion import SplineMotion
from katana450.extensions.real_arm.encoder_map import AXIS_FACTS, DRIVEN, EncoderMap
from katana450.maths.geometry.arrays import FloatArray

FINGER_STEP = 4
"""[encoders] Change of the setpoint that is worth a target."""

SETTLING_TIME = 0.5
"""[s] Time after a target for which the fingers count as moving, however slowly they do."""

FINGER_SPEED = 100.0
"""[encoders/s] Speed above which the fingers move."""


class FingerOrders:
    """Targets of the gripper. Only a setpoint that changes gives one, so a stop is not undone."""

    def __init__(self, axis: int, speed: float) -> None:
        """Create it for ``axis``, whose maximum is ``speed`` [encoders per tick]."""
        self._axis = axis
        self._speed = speed * 100.0
        self._setpoint: float | None = None
        self._given: float | None = None
        self._ordered: int | None = None
        self._ordered_at = -math.inf
        self._from = 0.0

    def ignore(self, setpoint: float) -> None:
        """Take ``setpoint`` [encoders] as one that gives no target."""
        self._setpoint = self._given = setpoint
        self._ordered = None

    def add(self, setpoint: float) -> None:
        """Take a setpoint [encoders]."""
        if self._given is None:
            self.ignore(setpoint)
        self._setpoint = setpoint

    def next_order(self) -> CommandMotor | None:
        """Return the order that the setpoint requires, or None. ``sent`` must follow."""
        if self._setpoint is None or self._given is None:
            return None
        if abs(self._setpoint - self._given) < FINGER_STEP:
            return None
        return CommandMotor(self._axis, MotorFlag.MOVE, round(self._setpoint))

    def sent(self, order: CommandMotor, position: int, now: float) -> None:
        """Note that the arm confirmed ``order`` with its fingers at ``position`` [encoders]."""
        expected = self.position_at(now)
        self._from = float(position) if expected is None else expected
        self._given = float(order.value)
        self._ordered, self._ordered_at = order.value, now

    def position_at(self, t: float) -> float | None:
        """Return where the fingers should be at ``t`` [s]; None if they have no target."""
        if self._ordered is None:
            return None
        reach = self._speed * max(t - self._ordered_at, 0.0)
        return self._from + float(np.clip(self._ordered - self._from, -reach, reach))

    def moves(self, now: float, speed: float) -> bool:
        """Return whether the fingers move at ``now`` [s]. ``speed``: measured [encoders/s]."""
        if self._ordered is None:
            return False
        return now - self._ordered_at < SETTLING_TIME or abs(speed) > FINGER_SPEED


FINGER = 5
"""Place of the fingers among the six axes."""

SMALLEST_STEP = 1.0
"""[encoders] Change of the setpoint that begins a motion."""

LARGEST_STEP = np.radians(2.0)
"""[rad] Distance of the first setpoint of a motion from the arm above which none begins."""

SETTLE_TIMEOUT = 2.0
"""[s] Time after a motion in which all axes must hold."""

MOVING_SPEED = 200.0
"""[encoders/s] Speed of any axis above which the arm moves without an order."""


class ArmMotion:
    """Motions of the arm, one after another, and targets of the gripper."""

    def __init__(self, encoders: EncoderMap, arm: ArmReadings) -> None:
        """Create it for the arm that ``arm`` measures."""
        self._encoders, self._arm = encoders, arm
        self._motions: deque[SplineMotion] = deque()
        self._finger = FingerOrders(FINGER + 1, AXIS_FACTS[FINGER].speed)
        self._finger_freed = self._ended_at = -np.inf
        self._ignored: FloatArray | None = None

    @property
    def axes(self) -> tuple[int, ...]:
        """Axes of the arm without its gripper, from 1."""
        return DRIVEN[:FINGER]

    def clear(self) -> None:
        """Drop all motions and targets, so that only a later setpoint moves anything."""
        self._motions.clear()
        self._finger = FingerOrders(FINGER + 1, AXIS_FACTS[FINGER].speed)

    def moves(self, now: float) -> bool:
        """Return whether anything moves at ``now`` [s], or is about to."""
        fast = float(np.abs(self._arm.speeds).max()) > MOVING_SPEED
        return bool(self._motions) or fast or self.finger_moves(now)

    def finger_moves(self, now: float) -> bool:
        """Return whether the fingers move at ``now`` [s]."""
        return self._finger.moves(now, float(self._arm.speeds[FINGER]))

    def ignore(self, encoders: FloatArray) -> None:
        """Take the setpoint (6,) [encoders] of a stopped arm: only a later change moves it."""
        self._ignored = encoders
        self._finger.ignore(encoders[FINGER])

    def follow(self, encoders: FloatArray, t: float) -> str:
        """Take the setpoint (6,) [encoders] of time ``t`` [s].

        Returns a sentence if it cannot be followed, otherwise an empty text.
        """
        self._finger.add(encoders[FINGER])
        if self._motions and self._motions[-1].is_late:
            return ""
        if not self._motions or not self._motions[-1].takes_setpoints:
            start = self._motions[-1].target if self._motions else self._arm.held
            away = np.abs(encoders - start)[:FINGER]
            known = start if self._motions or self._ignored is None else self._ignored
            if np.abs(encoders - known)[:FINGER].max() < SMALLEST_STEP:
                return ""
            if (away * np.abs(self._encoders.scale[:FINGER])).max() > LARGEST_STEP:
                return "The setpoint is not where the arm is, so no motion began."
            self._ignored = None
            self._motions.append(SplineMotion(start, self._encoders.speed))
        motion = self._motions[-1]
        motion.add(t, np.array([*encoders[:FINGER], motion.target[FINGER]]))
        return ""

    def next_packet(self, now: float) -> SendSplines | None:
        """Return the polynomials to send at ``now`` [s], or None."""
        return self._motions[0].next_packet(now) if self._motions else None

    def can_wait(self, now: float) -> bool:
        """Return whether the arm has polynomials for a while at ``now`` [s], or needs none."""
        return not self._motions or self._motions[0].can_wait(now)

    def finger_order(self) -> CommandMotor | None:
        """Return the order to the gripper that waits, or None."""
        if FINGER + 1 in self._arm.collided and self._arm.states_t > self._finger_freed:
            # The fingers stop at an object because they hold it. The arm has not collided.
            position = int(self._arm.positions[FINGER])
            return CommandMotor(FINGER + 1, MotorFlag.FREEZE, position)
        return self._finger.next_order()

    def sent(self, request: ArmRequest, t: float) -> None:
        """Note that the arm confirmed ``request``, an order of this motion, at ``t`` [s]."""
        if isinstance(request, SendSplines):
            self._motions[0].sent(request, t)
        elif isinstance(request, CommandMotor):
            if request.flag == MotorFlag.MOVE:
                self._finger.sent(request, int(self._arm.positions[FINGER]), t)
            else:
                self._finger_freed = t
            self._arm.held = np.array([*self._arm.held[:FINGER], request.value])

    def settle(self, now: float) -> str:
        """End a motion that the arm has played, by the newest states.

        Returns a sentence if something is wrong with it, otherwise an empty text.
        """
        if not self._motions or not self._motions[0].has_ended(self._arm.states_t):
            self._ended_at = now
            return ""
        motion = self._motions[0]
        if motion.is_late:
            return "The setpoints came too late, so the arm was braked."
        unsettled = set(self.axes) - set(self._arm.axes_in(*AT_REST))
        if not unsettled:
            self._arm.held = np.array([*motion.target[:FINGER], self._arm.held[FINGER]])
            self._motions.popleft()
        elif now - self._ended_at > SETTLE_TIMEOUT:
            return f"The arm did not end its motion. {self._arm.words(min(unsettled))}"
        return ""

    def expected_at(self, t: float) -> FloatArray:
        """Return where arm and fingers should be at ``t`` [s], (6,) [encoders]."""
        place = self._arm.held.astype(float)
        if self._motions:
            place[:FINGER] = self._motions[0].position_at(t)[:FINGER]
        finger = self._finger.position_at(t)
        if finger is not None:
            place[FINGER] = finger
        return place
