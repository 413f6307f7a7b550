"""Orders to the gripper, which moves to targets: polynomials do not move it."""

from __future__ import annotations

import math

import numpy as np

from katana450.extensions.real_arm.codec.requests import CommandMotor, MotorFlag

SMALLEST_STEP = 4
"""[encoders] Change of the setpoint that is worth a target."""

SETTLING_TIME = 0.5
"""[s] Time after a target for which the fingers count as moving, however slowly they do."""

MOVING_SPEED = 100.0
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
        if abs(self._setpoint - self._given) < SMALLEST_STEP:
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
        return now - self._ordered_at < SETTLING_TIME or abs(speed) > MOVING_SPEED
