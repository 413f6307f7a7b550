"""The joints of a mechanism that is driven joint by joint."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from katana450.arm.control.arm import limits_of
from katana450.arm.control.objects.gripper_model import NO_GRIPPER, GripperModel
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import Limits


@dataclass(frozen=True, eq=False)
class JointSet:
    """The driven joints of a mechanism, which follow no other joint.

    Attributes:
        names: name of each joint, in the order of every joint vector.
        slides: whether each joint is prismatic; its numbers are in m then, else in rad.
        lower, upper, speed: (n,) limits.
        why: a sentence on why no tool of the mechanism can be brought to a pose.
    """

    names: tuple[str, ...]
    slides: tuple[bool, ...]
    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    why: str

    arm: ClassVar[None] = None

    @property
    def n(self) -> int:
        """Number of driven joints."""
        return len(self.names)

    @property
    def limits(self) -> Limits:
        """Limits of position, speed, acceleration and jerk of the joints."""
        return limits_of(self.lower, self.upper, self.speed)

    @property
    def refusal(self) -> str:
        """The refusal of a command about a tool, in sentences."""
        return f"Only its joints can be driven. {self.why}"

    @property
    def gripper(self) -> GripperModel:
        """No gripper: the fingers are joints like any other."""
        return NO_GRIPPER

    @property
    def ready(self) -> FloatArray:
        """The posture (n,) with all joints at zero, or at the limit nearest to zero."""
        return self.clamp(np.zeros(self.n))

    def clamp(self, q: FloatArray) -> FloatArray:
        """Return the posture inside the limits that is nearest to ``q`` (n,)."""
        return frozen(np.clip(q, self.lower, self.upper))

    def check(self, q: FloatArray) -> None:
        """Raise InputError unless ``q`` has n numbers."""
        if q.shape != (self.n,):
            raise InputError(
                f"This mechanism has {self.n} driven joints, but the command has {q.size}."
            )
