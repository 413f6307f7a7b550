"""Conversion between encoders of an arm and joints of the robot description."""

from __future__ import annotations

import numpy as np

from katana450.errors import ConfigurationError
from katana450.extensions.real_arm.variants import Variant
from katana450.maths.geometry.arrays import FloatArray, IntArray, frozen

LIMIT_TOLERANCE = np.radians(0.5)
"""[rad] Maximum difference between the limits of an arm and those of its description."""


class EncoderMap:
    """Linear map between encoders and joints of all six axes; the last joint is the finger.

    Attributes:
        scale: (6,) joint angle per encoder [rad], with its sign.
        lower, upper: (6,) limits [encoders].
        speed: (6,) maximum speeds [encoders per tick of 10 ms].
    """

    def __init__(self, variant: Variant) -> None:
        axes = variant.axes
        self.scale = frozen([axis.joint_per_encoder for axis in axes])
        self.lower = frozen([axis.encoder_min for axis in axes])
        self.upper = frozen([axis.encoder_max for axis in axes])
        self.speed = frozen([axis.speed for axis in axes])
        self._joint_at_offset = frozen([axis.joint_at_offset for axis in axes])
        self._offset = frozen([axis.encoder_offset for axis in axes])
        self._name = variant.name

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
                f"The robot description is not that of a Katana450 {self._name}: its joint limits "
                f"differ. Use the description of this arm, or no --arm."
            )
