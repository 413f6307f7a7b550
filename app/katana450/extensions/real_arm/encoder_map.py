"""The axes of the arm: their encoders, their joints, and the map between both.

The numbers are those of the manufacturer's configuration of a Katana450 6M180 with its gripper. For
the angled arms (6M90), the Katana300 and the Katana400, whose axes have other ranges, no numbers
are at hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450.errors import ConfigurationError
from katana450.maths.geometry.arrays import FloatArray, IntArray, frozen

FINGER_RATIO = -0.32543
"""Angle of the finger joint per angle of the gripper's motor."""

FINGER_CLOSED = -0.44
"""[rad] Finger joint where the gripper is closed, at MOTOR_CLOSED."""

MOTOR_CLOSED = 0.21653
"""[rad] Angle of the gripper's motor where the gripper is closed."""

MAX_SPEED = 180
"""[encoders per tick] Maximum speed of every axis, as the motor counts."""


@dataclass(frozen=True)
class AxisFacts:
    """Encoder and joint of one axis.

    The angle of the manufacturer is ``angle_offset - (encoder - encoder_offset) * 360 /
    (encoders_per_turn * direction)`` in degrees; the joint of the robot description is
    ``joint_ratio * angle + joint_shift``.

    Attributes:
        encoders_per_turn: Encoders per turn of the axis.
        encoder_offset: Encoder at the stop where the axis is calibrated.
        angle_offset: Angle there [degrees].
        direction: 1 or -1.
        encoder_min, encoder_max: Range.
        speed: Maximum speed [encoders per tick of 10 ms].
        joint_ratio: Joint angle per angle.
        joint_shift: Joint angle at the angle zero [rad].
    """

    encoders_per_turn: int
    encoder_offset: int
    angle_offset: float
    direction: int
    encoder_min: int
    encoder_max: int
    speed: int
    joint_ratio: float
    joint_shift: float

    @property
    def joint_per_encoder(self) -> float:
        """Joint angle per encoder [rad]."""
        return -self.joint_ratio * math.tau / (self.encoders_per_turn * self.direction)

    @property
    def joint_at_offset(self) -> float:
        """Joint angle where the axis is calibrated [rad]."""
        return self.joint_ratio * math.radians(self.angle_offset) + self.joint_shift


AXIS_FACTS = (
    AxisFacts(51200, 31000, 6.65, 1, -17213, 31000, MAX_SPEED, 1.0, -math.pi),
    AxisFacts(94976, -31000, 124.25, 1, -31000, 3824, MAX_SPEED, -1.0, 0.0),
    # The protocol counts the encoder of this axis halved, so its maximum speed is halved too.
    AxisFacts(47488, -31000, 52.7, -1, -31000, 1318, MAX_SPEED // 2, -1.0, math.pi),
    AxisFacts(51200, 31000, 63.5, 1, -857, 31000, MAX_SPEED, 1.0, -math.pi),
    AxisFacts(51200, 31000, 8.5, 1, -16786, 31000, MAX_SPEED, -1.0, math.pi),
    AxisFacts(
        51200,
        31000,
        -119.5,
        1,
        -15791,
        31000,
        MAX_SPEED,
        FINGER_RATIO,
        FINGER_CLOSED - FINGER_RATIO * MOTOR_CLOSED,
    ),
)
"""The axes, of which the last one is the gripper's motor."""

DRIVEN = tuple(range(1, len(AXIS_FACTS) + 1))
"""Numbers of the axes that are commanded, from 1."""

LIMIT_TOLERANCE = np.radians(0.5)
"""[rad] Maximum difference between the limits of an arm and those of its description."""


class EncoderMap:
    """Linear map between encoders and joints of all six axes; the last joint is the finger.

    Attributes:
        scale: (6,) joint angle per encoder [rad], with its sign.
        lower, upper: (6,) limits [encoders].
        speed: (6,) maximum speeds [encoders per tick of 10 ms].
    """

    def __init__(self) -> None:
        axes = AXIS_FACTS
        self.scale = frozen([axis.joint_per_encoder for axis in axes])
        self.lower = frozen([axis.encoder_min for axis in axes])
        self.upper = frozen([axis.encoder_max for axis in axes])
        self.speed = frozen([axis.speed for axis in axes])
        self._joint_at_offset = frozen([axis.joint_at_offset for axis in axes])
        self._offset = frozen([axis.encoder_offset for axis in axes])

    def joints(self, encoders: FloatArray | IntArray) -> FloatArray:
        """Return the joints (6,) [rad] at ``encoders`` (6,)."""
        return frozen(self._joint_at_offset + (encoders - self._offset) * self.scale)

    def encoders(self, joints: FloatArray) -> FloatArray:
        """Return the encoders (6,) at ``joints`` (6,) [rad]: not rounded, not limited."""
        return frozen(self._offset + (joints - self._joint_at_offset) / self.scale)

    def check_limits(self, lower: FloatArray, upper: FloatArray) -> None:
        """Raise ConfigurationError if the joint limits (n,) [rad] are not those of the arm."""
        ends = np.sort([self.joints(self.lower)[:5], self.joints(self.upper)[:5]], axis=0)
        if lower.shape != (5,) or np.abs(ends - [lower, upper]).max() > LIMIT_TOLERANCE:
            raise ConfigurationError(
                "The robot description is not that of a Katana450 6M180: its joint limits differ. "
                "Use the description of this arm, or no --device."
            )
