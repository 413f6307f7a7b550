"""The numbers of a pose as the panel shows and accepts them: units, and frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray

BASE, SHOULDER = "Base", "Shoulder {S}"
"""Frames of the numbers."""


class DisplayUnit(NamedTuple):
    """A unit of length or angle.

    Attributes:
        name: its symbol.
        per_si: number of units in a metre or a radian.
        decimals: number of decimals that are shown.
        step: step of a number box, in this unit.
    """

    name: str
    per_si: float
    decimals: int
    step: float


LENGTHS = (
    DisplayUnit("mm", 1e3, 1, 1.0),
    DisplayUnit("cm", 1e2, 2, 0.1),
    DisplayUnit("in", 1.0 / 0.0254, 3, 0.05),
)
ANGLES = (DisplayUnit("°", math.degrees(1.0), 1, 1.0), DisplayUnit("rad", 1.0, 3, 0.01))

UNITS = {f"{length.name}, {angle.name}": (length, angle) for angle in ANGLES for length in LENGTHS}
"""Units of length and angle, by the name of their choice."""


class PoseDisplay(NamedTuple):
    """Conversion between poses in {S} and the numbers of the panel.

    Attributes:
        length: unit of the position.
        angle: unit of roll, pitch and yaw.
        frame: BASE or SHOULDER.
        T_base_shoulder: (4, 4) the frame {S} in the base frame [m].
    """

    length: DisplayUnit
    angle: DisplayUnit
    frame: str
    T_base_shoulder: FloatArray

    @property
    def frame_name(self) -> str:
        """The short name of the frame."""
        return "base" if self.frame == BASE else "{S}"

    def numbers(self, T: FloatArray) -> tuple[list[float], list[float]]:
        """Return position [length] and roll, pitch, yaw [angle] of ``T`` (4, 4) in {S}."""
        shown = self.T_base_shoulder @ T if self.frame == BASE else T
        position = self.length.per_si * shown[:3, 3]
        angles = [self.angle.per_si * angle for angle in so3.to_rpy(shown[:3, :3])]
        return position.tolist(), angles

    def pose(self, position: Sequence[float], angles: Sequence[float]) -> FloatArray:
        """Return the pose (4, 4) in {S} of a position [length] and roll, pitch, yaw [angle]."""
        R = so3.from_rpy(*(angle / self.angle.per_si for angle in angles))
        T = se3.from_rotation_translation(R, np.array(position) / self.length.per_si)
        return se3.inverse(self.T_base_shoulder) @ T if self.frame == BASE else T
