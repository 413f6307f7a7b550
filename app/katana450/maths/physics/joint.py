"""The joint between a body and the ground: a drawer slides, a door turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array

MAX_TURN, MAX_SLIDE = math.radians(170.0), 4.0
"""[rad, m] Maximum distance of the ends of a range from zero."""

MAX_LOAD, MAX_BODY_MASS = 1e4, 1e3
"""[N, N s/m, or N m, N m s/rad; kg] Maximum friction and damping of a joint, and mass of a body."""

UNIT_ERROR = 1e-9
"""[1] Maximum difference of the length of an axis from 1."""


@dataclass(frozen=True)
class BodyJoint:
    """A joint with one axis between a body and the ground.

    Attributes:
        slides: whether the body slides along the axis; otherwise it turns about it.
        point: a point (3,) of the axis in the base frame [m].
        axis: its direction (3,) in the base frame, of length 1.
        lower, upper: range of the joint [m or rad], with zero in it.
        friction: force or torque from which the joint moves [N or N m].
        damping: [N s/m or N m s/rad].
        mass: of the body [kg]; None for that of its volume.
    """

    slides: bool
    point: tuple[float, float, float]
    axis: tuple[float, float, float]
    lower: float
    upper: float
    friction: float = 0.0
    damping: float = 0.0
    mass: float | None = None

    def __post_init__(self) -> None:
        numbers = finite_array(
            (*self.point, *self.axis, self.lower, self.upper, self.friction, self.damping),
            (10,),
            "The numbers of a joint",
        )
        if abs(math.hypot(*self.axis) - 1.0) > UNIT_ERROR or np.abs(numbers[:3]).max() > MAX_SLIDE:
            raise InputError(
                f"The axis of a joint must have the length 1 and be at most {MAX_SLIDE:g} m away."
            )
        end, unit = (MAX_SLIDE, "m") if self.slides else (MAX_TURN, "rad")
        if not -end <= self.lower <= 0.0 <= self.upper <= end or self.lower == self.upper:
            raise InputError(
                f"The range of a joint must contain 0 and lie between -{end:.4g} and {end:.4g} "
                f"{unit}, not {self.lower:g} to {self.upper:g}."
            )
        if not (0.0 <= self.friction <= MAX_LOAD and 0.0 <= self.damping <= MAX_LOAD):
            raise InputError(
                f"Friction and damping of a joint must be from 0 to {MAX_LOAD:g}, not "
                f"{self.friction:g} and {self.damping:g}."
            )
        if self.mass is not None and not 1e-3 <= self.mass <= MAX_BODY_MASS:
            raise InputError(
                f"The mass of a body on a joint must be from 0.001 to {MAX_BODY_MASS:g} kg, not "
                f"{self.mass:g}."
            )

    def motion(self, position: float) -> FloatArray:
        """Return the motion (4, 4) of the body from zero to ``position`` [m or rad]."""
        if self.slides:
            return se3.from_rotation_translation(np.eye(3), position * np.array(self.axis))
        R, point = so3.exp(position * np.array(self.axis)), np.array(self.point)
        return se3.from_rotation_translation(R, point - R @ point)

    def position(self, motion: FloatArray) -> float:
        """Return the position [m or rad] in the range whose motion is nearest to ``motion``.

        motion: (4, 4) any motion of the body from zero.
        """
        R, axis = motion[:3, :3], np.array(self.axis)
        if self.slides:
            position = float(axis @ motion[:3, 3])
        else:
            position = math.atan2(float(axis @ so3.vee(R)), 0.5 * (float(np.trace(R)) - 1.0))
        return min(max(position, self.lower), self.upper)
