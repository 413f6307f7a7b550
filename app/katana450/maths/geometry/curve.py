"""Curves of joint vectors, with bounds on how far they are from straight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class JointCurve:
    """A curve of variables, by the fraction of it from 0 to 1.

    Attributes:
        place: the variables (k,) [rad or m] at a fraction.
        bend: bound (k,) [rad or m] on the size of their second derivative between two fractions,
            times the square of the difference of both. No variable is farther from the chord than
            an eighth of it, and no rate from that of the chord than half of it.
    """

    place: Callable[[float], FloatArray]
    bend: Callable[[float, float], FloatArray]

    def piece(self, a: float, b: float) -> JointCurve:
        """Return the part of the curve between two fractions."""
        size = b - a
        return JointCurve(
            lambda part: self.place(b if part == 1.0 else a + part * size),
            lambda low, high: self.bend(a + low * size, a + high * size),
        )

    def pieces(self, count: int) -> list[JointCurve]:
        """Return the curve in ``count`` parts of equal fractions."""
        return [self.piece(number / count, (number + 1) / count) for number in range(count)]

    def beside(self, others: FloatArray) -> JointCurve:
        """Return the curve with ``others`` (m,), which stay as they are, after its variables."""
        still = np.zeros_like(others)
        return JointCurve(
            lambda part: np.append(self.place(part), others),
            lambda low, high: np.append(self.bend(low, high), still),
        )
