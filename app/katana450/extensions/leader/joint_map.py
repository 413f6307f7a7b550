"""Positions of the leader's motors as a posture of the arm, by their calibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from katana450.errors import InputError
from katana450.extensions.motor_bus.calibration import (
    GRIPPER,
    Calibration,
    MotorCalibration,
    calibration_of,
)
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.sdk import answers


class AxisSource(NamedTuple):
    """The joint of the leader that one joint of the arm follows.

    Attributes:
        motor: name of the motor in the calibration file.
        sign: 1 if both turn in the same direction, -1 otherwise.
        offset: angle of the arm's joint in the middle of the motor's range [deg].
    """

    motor: str
    sign: int
    offset: float = 0.0


AXES = (
    # The leader's pan turns about its axis downwards, the arm's about its axis upwards.
    AxisSource("shoulder_pan", -1),
    AxisSource("shoulder_lift", 1, -76.0),
    AxisSource("elbow_flex", 1, 73.8),
    AxisSource("wrist_flex", 1, 2.2),
    # The leader's roll turns about its axis backwards, the arm's about its axis forwards.
    AxisSource("wrist_roll", -1),
)
"""The joints of the SO-101 leader."""

LIMIT_MARGIN = 1e-4
"""[rad] Distance that is kept from the limits of the joints, so that no rounding exceeds them."""


@dataclass(frozen=True, eq=False)
class LeaderPosture:
    """The posture of the leader in the joints of the arm.

    Attributes:
        raw: (n,) joint angles without limits [rad].
        q: (n,) the same within the limits of the arm [rad].
        finger: finger joint [rad, or m for fingers that slide]; None without one on both sides.
    """

    raw: FloatArray
    q: FloatArray
    finger: float | None


class JointMap:
    """The relation between the motors of a leader and the joints of an arm.

    Attributes:
        motors: ids of the motors that it uses.
        finger_range: finger joint closed and open; None without one on both sides.
    """

    def __init__(self, calibration: Calibration, arm: answers.Arm) -> None:
        """Take the joints of the leader for those of ``arm``, in their order.

        Raises InputError if a motor is not calibrated or the joints do not correspond.
        """
        if len(AXES) != len(arm.lower) or any(arm.slides):
            raise InputError(
                f"{arm.name} has {len(arm.lower)} joints, {sum(arm.slides)} of which slide. The "
                f"leader has {len(AXES)} that turn, so it cannot drive this arm."
            )
        self._axes = [(calibration_of(calibration, axis.motor), axis) for axis in AXES]
        self._finger: MotorCalibration | None = None
        self.finger_range: tuple[float, float] | None = None
        if arm.gripper is not None:
            self._finger, self.finger_range = calibration_of(calibration, GRIPPER), arm.gripper[:2]
        motors = [motor.id for motor, _ in self._axes]
        self.motors = tuple(motors if self._finger is None else [*motors, self._finger.id])
        self._lower = np.array(arm.lower) + LIMIT_MARGIN
        self._upper = np.array(arm.upper) - LIMIT_MARGIN

    def posture(self, ticks: Mapping[int, int]) -> LeaderPosture:
        """Return the posture at the positions ``ticks``, by the ids of the motors."""
        raw = frozen(
            np.array(
                [
                    axis.sign * motor.angle(ticks[motor.id]) + math.radians(axis.offset)
                    for motor, axis in self._axes
                ]
            )
        )
        q = frozen(np.clip(raw, self._lower, self._upper))
        if self._finger is None or self.finger_range is None:
            return LeaderPosture(raw, q, None)
        closed, opened = self.finger_range
        fraction = self._finger.fraction(ticks[self._finger.id])
        return LeaderPosture(raw, q, closed + fraction * (opened - closed))
