"""Facts on the motors of the emulated arm, a Katana450 6M180 with an angle gripper."""

from __future__ import annotations

import math
from dataclasses import dataclass

from katana450.extensions.real_arm.variants import DEFAULT_VARIANT, MAX_SPEED, AxisFacts


@dataclass(frozen=True)
class MotorFacts:
    """One motor as its controller knows it after power-up.

    Attributes:
        axis: encoder and joint.
        speed: speed limit [counts / 10 ms], as the motor counts.
        collision_limit: deviation from the setpoint that counts as a collision [counts].
    """

    axis: AxisFacts
    speed: int
    collision_limit: int

    @property
    def counts_per_radian(self) -> float:
        """Encoder counts in a radian of the joint's motor."""
        return self.axis.encoders_per_turn / math.tau

    @property
    def stops(self) -> tuple[int, int]:
        """Mechanical stops in counts of the calibrated arm, the lower one first."""
        return self.axis.encoder_min, self.axis.encoder_max

    @property
    def stop(self) -> int:
        """Counts of the stop that the calibration searches."""
        return self.axis.encoder_offset

    @property
    def sign(self) -> int:
        """Direction of that stop: 1 or -1."""
        return 1 if self.stop > 0 else -1

    @property
    def halving(self) -> float:
        """Counts of the motor in a count of the protocol; its limits are in those of the motor."""
        return MAX_SPEED / self.axis.speed


CONFIGURED = ((30, 250), (25, 200), (20, 250), (25, 200), (25, 100), (25, 100))
"""Speed and collision limits of the axes, from the configuration of this arm."""

MOTORS = tuple(
    MotorFacts(axis, *limits) for axis, limits in zip(DEFAULT_VARIANT.axes, CONFIGURED, strict=True)
)

CALIBRATION_ORDER = (2, 3, 4, 5, 6, 1)
"""Axes in the order in which they are calibrated."""

CALIBRATED_AT = 30500
"""Counts, with the sign of the stop, at which the calibration leaves an axis of a real arm."""

MAX_ACCELERATION = 20000.0
"""[counts/s^2] Larger of the two acceleration limits, 2 counts / (10 ms)^2."""

POWER_UP_POSTURE = (12000, -24000, -22000, 20000, 12000, 24000)
"""Counts where the emulated arm stands before its first calibration."""
