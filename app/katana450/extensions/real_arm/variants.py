"""Configuration of the axes of each variant of the arm whose numbers are known.

The numbers are those of the manufacturer's configuration of a Katana450 6M180. For the angled
variants (6M90), the Katana300 and the Katana400, whose axes have other ranges, no numbers are at
hand: add them here when they have been read from the configuration of such an arm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

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


@dataclass(frozen=True)
class Variant:
    """An arm as it was configured.

    Attributes:
        name: Name of its configuration.
        axes: (6,) Its axes; the last one is the gripper's motor.
        has_gripper: Whether a gripper is mounted. Without it the sixth axis is never commanded.
    """

    name: str
    axes: tuple[AxisFacts, ...]
    has_gripper: bool = True

    @property
    def driven(self) -> tuple[int, ...]:
        """Numbers of the axes that are commanded, from 1."""
        return tuple(range(1, len(self.axes) + self.has_gripper))


_AXES = (
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

VARIANTS: Mapping[str, Variant] = MappingProxyType(
    {
        each.name: each
        for each in (Variant("6M180_G", _AXES), Variant("6M180_F", _AXES, has_gripper=False))
    }
)
"""Known variants by name: the straight arm with its angle gripper, and with a bare flange."""

DEFAULT_VARIANT = VARIANTS["6M180_G"]
