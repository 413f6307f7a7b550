"""The numbers of a pose as the panel shows and accepts them: unit of length, and frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray

BASE, SHOULDER = "Base", "Shoulder {S}"
"""Frames of the numbers."""


class LengthUnit(NamedTuple):
    """A unit of length.

    Attributes:
        name: its symbol.
        per_metre: number of units in a metre.
        decimals: number of decimals that are shown.
        step: step of a number box, in this unit.
    """

    name: str
    per_metre: float
    decimals: int
    step: float


UNITS = {
    unit.name: unit
    for unit in (
        LengthUnit("mm", 1e3, 1, 1.0),
        LengthUnit("cm", 1e2, 2, 0.1),
        LengthUnit("in", 1.0 / 0.0254, 3, 0.05),
    )
}


class PoseDisplay(NamedTuple):
    """Conversion between poses in {S} and the numbers of the panel.

    Attributes:
        unit: unit of the position.
        frame: BASE or SHOULDER.
        T_base_shoulder: (4, 4) the frame {S} in the base frame [m].
    """

    unit: LengthUnit
    frame: str
    T_base_shoulder: FloatArray

    @property
    def frame_name(self) -> str:
        """The short name of the frame."""
        return "base" if self.frame == BASE else "{S}"

    def numbers(self, T: FloatArray) -> tuple[list[float], list[float]]:
        """Return position [unit] and roll, pitch, yaw [deg] of the pose ``T`` (4, 4) in {S}."""
        shown = self.T_base_shoulder @ T if self.frame == BASE else T
        position = self.unit.per_metre * shown[:3, 3]
        return position.tolist(), [math.degrees(angle) for angle in so3.to_rpy(shown[:3, :3])]

    def pose(self, position: Sequence[float], angles: Sequence[float]) -> FloatArray:
        """Return the pose (4, 4) in {S} of a position [unit] and roll, pitch, yaw [deg]."""
        R = so3.from_rpy(*(math.radians(angle) for angle in angles))
        T = se3.from_rotation_translation(R, np.array(position) / self.unit.per_metre)
        return se3.inverse(self.T_base_shoulder) @ T if self.frame == BASE else T
