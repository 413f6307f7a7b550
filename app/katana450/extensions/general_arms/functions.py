"""The steps that the closed forms share, for floats and for arrays of many poses.

Each step is a Paden-Kahan subproblem (tests/kinematics/subproblems.py), written out for axes along
z of their own frames, where it needs no vectors. A step without an exact answer returns the nearest
one, and a step that leaves an angle free returns the angle that the caller gives.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np

from katana450.extensions.general_arms.links import sine_and_cosine

# A float or an array: the formulas are the same.
Number = Any
Numbers = tuple[Number, ...]

FREE: Final = 1e-13
"""[1] or [m] Distance from an axis below which the turn about it is free. Any turn then
displaces the tool by less than rounding and the length of an arm."""


class Operations(NamedTuple):
    """The functions of `math` or of numpy that the formulas use.

    Attributes:
        atan2, hypot, cos, sin: as in `math`.
        root: sqrt(x), and 0 where x < 0.
        select: (condition, a, b) to a where the condition holds, else b.
        bounded: the nearest number in [-1, 1].
        rarely: (condition, function, arguments, usual) to function(*arguments) in the rare case in
            which the condition holds, else ``usual``. Arrays always have ``usual``.
    """

    atan2: Callable[[Number, Number], Number]
    hypot: Callable[[Number, Number], Number]
    cos: Callable[[Number], Number]
    sin: Callable[[Number], Number]
    root: Callable[[Number], Number]
    select: Callable[[Number, Number, Number], Number]
    bounded: Callable[[Number], Number]
    rarely: Callable[[Number, Callable[..., Numbers], tuple[Number, ...], Numbers], Numbers]


def _root(x: float) -> float:
    return math.sqrt(x) if x > 0.0 else 0.0


def _select(condition: bool, a: float, b: float) -> float:
    return a if condition else b


def _bounded(x: float) -> float:
    return -1.0 if x < -1.0 else min(x, 1.0)


FLOATS: Final = Operations(
    math.atan2,
    math.hypot,
    math.cos,
    math.sin,
    _root,
    _select,
    _bounded,
    lambda condition, function, arguments, usual: function(*arguments) if condition else usual,
)

ARRAYS: Final = Operations(
    np.arctan2,
    np.hypot,
    np.cos,
    np.sin,
    lambda x: np.sqrt(np.maximum(x, 0.0)),
    np.where,
    lambda x: np.clip(x, -1.0, 1.0),
    lambda _condition, _function, _arguments, usual: usual,
)

Facing = tuple[tuple[Number, Number, Number], tuple[Number, Number, Number]]


def facing(f: Operations) -> Callable[[Number, Number, Number, Number], Facing]:
    """Return a function that turns axis 1 until the point (x, y) is ``d`` beside its x axis.

    It returns (cos, sin, x') of both turns, with x' = x cos + y sin, first the one with x' >= 0:
    subproblem 4, -x sin + y cos = d. A point within |d| of axis 1 gets the turn that brings it
    nearest. A point on axis 1 leaves the turn to ``free`` [rad], if d is 0.
    """
    hypot, root, select, bounded, cos, sin = f.hypot, f.root, f.select, f.bounded, f.cos, f.sin

    def turns(x: Number, y: Number, d: Number, free: Number) -> Facing:
        rho = hypot(x, y)
        on_axis = rho <= FREE
        scale = 1.0 / select(on_axis, 1.0, rho)
        x, y = select(on_axis, cos(free), x * scale), select(on_axis, sin(free), y * scale)
        sine = bounded(d * scale)
        cosine = root((1.0 - sine) * (1.0 + sine))
        xc, yc, xs, ys = x * cosine, y * cosine, x * sine, y * sine
        ahead = rho * cosine
        return (xc + ys, yc - xs, ahead), (ys - xc, -yc - xs, -ahead)

    return turns


def two_links(
    f: Operations, l1: float, l2: float
) -> Callable[[Number, Number], tuple[Number, Number, Number]]:
    """Return a function for two links [m] that bring their end to (u, v) in a plane.

    It returns (towards, beside, bend) [rad]: the first link is at towards - beside with the second
    turned by +bend, or at towards + beside with -bend. Subproblems 3 and 1 by the law of cosines;
    its differences of squares are factored, so that no digits are lost where the links are
    stretched or folded. Out of reach the links point at (u, v), or away from it.
    """
    far, near = l1 + l2, abs(l1 - l2)
    squares = (l1 - l2) * far
    atan2, root, hypot = f.atan2, f.root, f.hypot

    def bent(u: Number, v: Number) -> tuple[Number, Number, Number]:
        rho = hypot(u, v)
        stretched, folded = (far - rho) * (far + rho), (rho - near) * (rho + near)
        sine = root(stretched * folded)
        beside = atan2(sine, rho * rho + squares)
        return atan2(v, u), beside, atan2(2.0 * sine, folded - stretched)

    return bent


Turns = tuple[Number, Number, Number, Number, Number]
Row = tuple[Number, Number, Number]


def three_turns(f: Operations, t: float, t2: float) -> Callable[..., tuple[Turns, Turns, Number]]:
    """Return a function that splits a rotation Q into Rz(a) Rx(t) Rz(b) Rx(t2) Rz(c).

    It takes the first two rows of Q, the ends of its third row, and ``free`` [rad], the angle a
    where Q leaves only the sum of a and c. It returns (a, b, c, cos a, sin a) twice, first
    with sin b >= 0, and the sine of the angle between the outer axes, which is 0 in that singular
    case. b is the angle of the spherical triangle with the sides t, t2 and the angle between the
    outer axes (subproblem 4 on directions); a turns the inner axes into place, and c is what is
    left (subproblem 1).
    """
    (s, c), (s2, c2) = sine_and_cosine(t), sine_and_cosine(t2)
    if c == c2 == 0.0:
        return _square_turns(f, s, s2)
    atan2, hypot, root, select, cos, sin = f.atan2, f.hypot, f.root, f.select, f.cos, f.sin
    total, rest, sign = 0.5 * (t + t2), 0.5 * (t - t2), math.copysign(1.0, s * s2)

    def split(
        first: Row, second: Row, q31: Number, q33: Number, free: Number
    ) -> tuple[Turns, Turns, Number]:
        (q11, _, q13), (q21, _, q23) = first, second
        radius = hypot(q13, q23)
        half = 0.5 * atan2(radius, q33)
        sine = root(sign * sin(total + half) * sin(total - half))
        cosine = root(sign * sin(half + rest) * sin(half - rest))
        found = []
        for signed in (sine, -sine):
            b = 2.0 * atan2(signed, cosine)
            cb, sb = cos(b), sin(b)
            a = atan2(q23, q13) - atan2(-c * s2 * cb - s * c2, s2 * sb)
            a = select(radius <= FREE, free, a)
            ca, sa = cos(a), sin(a)
            x, y = ca * q11 + sa * q21, ca * q21 - sa * q11
            y, z = c * y + s * q31, c * q31 - s * y
            x, y = cb * x + sb * y, cb * y - sb * x
            found.append((a, b, atan2(c2 * y + s2 * z, x), ca, sa))
        return found[0], found[1], radius

    return split


def _square_turns(f: Operations, s: float, s2: float) -> Callable[..., tuple[Turns, Turns, Number]]:
    """Return `three_turns` for twists of a quarter turn, with sines ``s`` and ``s2``.

    The second row of Rz(-a) Q is then -s s2 (sin c, cos c, 0), and its first row ends in s2 sin b.
    """
    atan2, hypot, select, cos, sin = f.atan2, f.hypot, f.select, f.cos, f.sin
    sign = -s * s2
    pi = math.pi

    def split(
        first: Row, second: Row, _: Number, q33: Number, free: Number
    ) -> tuple[Turns, Turns, Number]:
        (q11, q12, q13), (q21, q22, q23) = first, second
        radius = hypot(q13, q23)
        is_free = radius <= FREE
        scale = s2 / select(is_free, 1.0, radius)
        ca, sa = select(is_free, cos(free), scale * q13), select(is_free, sin(free), scale * q23)
        a, b = atan2(sa, ca), atan2(radius, sign * q33)
        c = atan2(sign * (ca * q21 - sa * q11), sign * (ca * q22 - sa * q12))
        return (a, b, c, ca, sa), (a + pi, -b, c + pi, -ca, -sa), radius

    return split
