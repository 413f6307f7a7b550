"""The joints of a mechanism that is driven joint by joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from katana450.arm.control.arm import NO_GRIPPER, GripperModel, limits_of
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import Limits


@dataclass(frozen=True, eq=False)
class JointSet:
    """Those that follow no other, in the order of every joint vector.

    Attributes:
        names: of each.
        slides: whether it is prismatic; its numbers are in m then, else in rad.
        lower, upper, speed: (n,) limits.
        why: why no tool of it can be brought to a pose, in a sentence.
    """

    names: tuple[str, ...]
    slides: tuple[bool, ...]
    lower: FloatArray
    upper: FloatArray
    speed: FloatArray
    why: str

    @property
    def n(self) -> int:
        """How many."""
        return len(self.names)

    @property
    def limits(self) -> Limits:
        """Of their motion."""
        return limits_of(self.lower, self.upper, self.speed)

    @property
    def refusal(self) -> str:
        """Why a command about a tool is refused, in sentences."""
        return f"Only its joints can be driven. {self.why}"

    @property
    def gripper(self) -> GripperModel:
        """Fingers are joints like any other."""
        return NO_GRIPPER

    @property
    def ready(self) -> FloatArray:
        """(n,) all at zero, or at the limit next to it."""
        return self.clamp(np.zeros(self.n))

    def clamp(self, q: FloatArray) -> FloatArray:
        """The nearest to `q` (n,) inside the limits."""
        return frozen(np.clip(q, self.lower, self.upper))

    def check(self, q: FloatArray) -> None:
        """InputError unless there are n numbers."""
        if q.shape != (self.n,):
            raise InputError(f"This mechanism has {self.n} driven joints, the command {q.size}.")
