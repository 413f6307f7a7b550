"""Functions of one variable with their first three derivatives, by truncated Taylor series.

A jet is the Taylor polynomial c0 + c1 h + c2 h^2 + c3 h^3 of a function at one place, or at many
places if its coefficients are arrays. Sums, products and functions of jets are jets, so a formula
written for numbers yields its derivatives to rounding (Griewank and Walther, Evaluating
Derivatives, 2008, ch. 13). Coefficients that are plain floats stay floats, which is fastest for one
place.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from katana450.maths.kinematics.solver import Functions

# A float or an array: the formulas are the same.
Coefficient = Any


class Jet:
    """A Taylor polynomial of third order."""

    __slots__ = ("c0", "c1", "c2", "c3")
    # An array on the left of an operator leaves the operation to the jet.
    __array_ufunc__ = None

    def __init__(self, c0: Coefficient, c1: Coefficient, c2: Coefficient, c3: Coefficient) -> None:
        self.c0 = c0
        self.c1 = c1
        self.c2 = c2
        self.c3 = c3

    @staticmethod
    def variable(value: Coefficient) -> Jet:
        """Return the variable itself, at one place or at many (N,)."""
        return Jet(value, 1.0, 0.0, 0.0)

    @staticmethod
    def constant(value: Coefficient) -> Jet:
        """Return a constant jet."""
        return Jet(value, 0.0, 0.0, 0.0)

    def derivatives(self) -> tuple[Coefficient, Coefficient, Coefficient, Coefficient]:
        """Return the value and the first three derivatives."""
        return self.c0, self.c1, 2.0 * self.c2, 6.0 * self.c3

    def __neg__(self) -> Jet:
        return Jet(-self.c0, -self.c1, -self.c2, -self.c3)

    def __add__(self, other: Number) -> Jet:
        if isinstance(other, Jet):
            return Jet(
                self.c0 + other.c0, self.c1 + other.c1, self.c2 + other.c2, self.c3 + other.c3
            )
        return Jet(self.c0 + other, self.c1, self.c2, self.c3)

    __radd__ = __add__

    def __sub__(self, other: Number) -> Jet:
        if isinstance(other, Jet):
            return Jet(
                self.c0 - other.c0, self.c1 - other.c1, self.c2 - other.c2, self.c3 - other.c3
            )
        return Jet(self.c0 - other, self.c1, self.c2, self.c3)

    def __rsub__(self, other: Coefficient) -> Jet:
        return Jet(other - self.c0, -self.c1, -self.c2, -self.c3)

    def __mul__(self, other: Number) -> Jet:
        a0, a1, a2, a3 = self.c0, self.c1, self.c2, self.c3
        if not isinstance(other, Jet):
            return Jet(a0 * other, a1 * other, a2 * other, a3 * other)
        b0, b1, b2, b3 = other.c0, other.c1, other.c2, other.c3
        return Jet(
            a0 * b0,
            a0 * b1 + a1 * b0,
            a0 * b2 + a1 * b1 + a2 * b0,
            a0 * b3 + a1 * b2 + a2 * b1 + a3 * b0,
        )

    __rmul__ = __mul__

    def __truediv__(self, other: Number) -> Jet:
        a0, a1, a2, a3 = self.c0, self.c1, self.c2, self.c3
        if not isinstance(other, Jet):
            return Jet(a0 / other, a1 / other, a2 / other, a3 / other)
        b0, b1, b2, b3 = other.c0, other.c1, other.c2, other.c3
        q0 = a0 / b0
        q1 = (a1 - q0 * b1) / b0
        q2 = (a2 - q0 * b2 - q1 * b1) / b0
        return Jet(q0, q1, q2, (a3 - q0 * b3 - q1 * b2 - q2 * b1) / b0)


Number = Jet | Coefficient


def sqrt(a: Jet) -> Jet:
    """Return the square root; NaN in all coefficients where `a` is not above 0."""
    r0 = math.sqrt(a.c0) if isinstance(a.c0, float) else np.sqrt(a.c0)
    half = 0.5 / r0
    r1 = half * a.c1
    r2 = half * (a.c2 - r1 * r1)
    return Jet(r0, r1, r2, half * (a.c3 - 2.0 * r1 * r2))


def sin_cos(a: Jet) -> tuple[Jet, Jet]:
    """Return sine and cosine."""
    a0, a1, a2, a3 = a.c0, a.c1, a.c2, a.c3
    one = isinstance(a0, float)
    s0, c0 = (math.sin(a0), math.cos(a0)) if one else (np.sin(a0), np.cos(a0))
    s1, c1 = c0 * a1, -s0 * a1
    s2, c2 = 0.5 * c1 * a1 + c0 * a2, -0.5 * s1 * a1 - s0 * a2
    s3 = (c2 * a1 + 2.0 * c1 * a2) / 3.0 + c0 * a3
    c3 = (s2 * a1 + 2.0 * s1 * a2) / -3.0 - s0 * a3
    return Jet(s0, s1, s2, s3), Jet(c0, c1, c2, c3)


def atan2(y: Jet, x: Jet) -> Jet:
    """Return the angle of (x, y), its value in (-pi, pi]."""
    one = isinstance(y.c0, float) and isinstance(x.c0, float)
    angle = math.atan2(y.c0, x.c0) if one else np.arctan2(y.c0, x.c0)
    dx = Jet(x.c1, 2.0 * x.c2, 3.0 * x.c3, 0.0)
    dy = Jet(y.c1, 2.0 * y.c2, 3.0 * y.c3, 0.0)
    rate = (x * dy - y * dx) / (x * x + y * y)
    return Jet(angle, rate.c0, rate.c1 / 2.0, rate.c2 / 3.0)


def direction(y: Jet, x: Jet) -> tuple[Jet, Jet, Jet]:
    """Return the angle of (x, y), its cosine and its sine."""
    length = sqrt(x * x + y * y)
    return atan2(y, x), x / length, y / length


JETS: Final = Functions(atan2, sqrt, sqrt, direction)
"""The functions with which the closed form runs on jets."""
