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

FREE: Final = 1e-13
"""[1] or [m] Distance from an axis below which the turn about it is free. Any turn then
displaces the tool by less than rounding and the length of an arm."""

DISTINCT: Final = 0.01
"""[1] Sine of the angle between two axes above which each of their turns is known to 1e-14 rad."""

BENT: Final = 0.1
"""[1] Sine of an angle above which its cosine gives it to 1e-15 rad."""


class Operations(NamedTuple):
    """The functions of `math` or of numpy that the formulas use.

    Attributes:
        atan2, hypot, cos, sin: as in `math`.
        root: sqrt(x), and 0 where x < 0.
        select: (condition, a, b) to a where the condition holds, else b.
        where_free: the same, for the condition that a pose leaves an angle free.
        bounded: the nearest number in [-1, 1].
        is_scalar: whether the numbers are floats. A formula may then take a shorter way where a
            condition holds, and has further ways for rare poses. Arrays take the way that is right
            for all poses but the rare ones.
    """

    atan2: Callable[[Number, Number], Number]
    hypot: Callable[..., Number]
    cos: Callable[[Number], Number]
    sin: Callable[[Number], Number]
    root: Callable[[Number], Number]
    select: Callable[[Number, Number, Number], Number]
    where_free: Callable[[Number, Number, Number], Number]
    bounded: Callable[[Number], Number]
    is_scalar: bool


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
    _select,
    _bounded,
    is_scalar=True,
)

ARRAYS: Final = Operations(
    np.arctan2,
    np.hypot,
    np.cos,
    np.sin,
    lambda x: np.sqrt(np.maximum(x, 0.0)),
    np.where,
    np.where,
    lambda x: np.clip(x, -1.0, 1.0),
    is_scalar=False,
)

Facing = tuple[tuple[Number, Number, Number], tuple[Number, Number, Number]]


def facing(f: Operations) -> Callable[[Number, Number, Number, Number], Facing]:
    """Return a function that turns axis 1 until the point (x, y) is ``d`` beside its x axis.

    It returns (cos, sin, x') of both turns, with x' = x cos + y sin, first the one with x' >= 0:
    subproblem 4, -x sin + y cos = d. A point within |d| of axis 1 gets the turn that brings it
    nearest. A point on axis 1 leaves the turn to ``free`` [rad], if d is 0.
    """
    hypot, root, where_free, cos, sin = f.hypot, f.root, f.where_free, f.cos, f.sin
    bounded = f.bounded
    is_scalar = f.is_scalar

    def turns(x: Number, y: Number, d: Number, free: Number) -> Facing:
        rho = hypot(x, y)
        if is_scalar and rho > FREE:
            cx, cy, sine = x / rho, y / rho, bounded(d / rho)
        else:
            on_axis = rho <= FREE
            scale = where_free(on_axis, 1.0, rho)
            cx = where_free(on_axis, cos(free), x / scale)
            cy = where_free(on_axis, sin(free), y / scale)
            sine = bounded(d / scale)
        cosine = root((1.0 - sine) * (1.0 + sine))
        xc, yc, xs, ys = cx * cosine, cy * cosine, cx * sine, cy * sine
        length = rho * cosine
        return (xc + ys, yc - xs, length), (ys - xc, -yc - xs, -length)

    return turns


def two_links(
    f: Operations, l1: float, l2: float
) -> Callable[[Number, Number], tuple[Number, Number, Number, Number]]:
    """Return a function for two links [m] that bring their end to (u, v) in a plane.

    It returns (towards, beside, bend) [rad]: the first link is at towards - beside with the second
    turned by +bend, or at towards + beside with -bend. Subproblems 3 and 1 by the law of cosines.
    Its product of differences is that of the squares, so that no more digits are lost where the
    links are stretched or folded than (u, v) has. Out of reach the links point at (u, v), or away
    from it. The last number is then negative, and 0 where the links are stretched or folded.
    """
    far, near = (l1 + l2) ** 2, (l1 - l2) ** 2
    less, squares = (l1 - l2) * (l1 + l2), l1 * l1 + l2 * l2
    atan2, root = f.atan2, f.root

    def bent(u: Number, v: Number) -> tuple[Number, Number, Number, Number]:
        size = u * u + v * v
        square = (far - size) * (size - near)
        sine = root(square)
        return atan2(v, u), atan2(sine, size + less), atan2(sine, size - squares), square

    return bent


Turns = tuple[Number, Number, Number, Number, Number]
Row = tuple[Number, Number, Number]


def three_turns(
    f: Operations, t: float, t2: float, *, frees_last: bool = False
) -> Callable[[Row, Row, Row, Number], tuple[Turns, Turns, Number]]:
    """Return a function that splits a rotation Q into Rz(a) Rx(t) Rz(b) Rx(t2) Rz(c).

    It takes the rows of Q, and ``free`` [rad], the angle a, or c if ``frees_last``, where Q leaves
    only the sum or the difference of both. It returns (a, b, c, cos a, sin a) twice, first with
    sin b >= 0, and the sine of the angle between the outer axes, which is 0 in that singular case.
    b is the angle of the spherical triangle with the sides t, t2 and the angle between the outer
    axes (subproblem 4 on directions); a turns the inner axes into place, and c is what is left
    (subproblem 1).
    """
    (s, c), (s2, c2) = sine_and_cosine(t), sine_and_cosine(t2)
    if c == c2 == 0.0:
        return _square_turns(f, s, s2, frees_last=frees_last)
    atan2, hypot, root, cos, sin = f.atan2, f.hypot, f.root, f.cos, f.sin
    total, rest, sign = 0.5 * (t + t2), 0.5 * (t - t2), math.copysign(1.0, s * s2)
    is_scalar, cosines, sines = f.is_scalar, c * c2, s * s2
    bound = abs(sines) * math.sqrt(1.0 - BENT * BENT)

    def distinct(q13: float, q23: float, q31: float, q32: float, q33: float) -> tuple[Turns, Turns]:
        """Return both turns where the last column and the last row of Q determine them."""
        cb = (cosines - q33) / sines
        sb = root(1.0 - cb * cb)
        b, y, z = atan2(sb, cb), -c * s2 * cb - s * c2, c2 * s * cb + s2 * c
        x, w = s2 * sb, s * sb
        scale = 1.0 / (x * x + y * y)
        xc, xs, yc, ys = x * q13 * scale, x * q23 * scale, y * q13 * scale, y * q23 * scale
        wc, ws, zc, zs = w * q31, w * q32, z * q31, z * q32
        return (
            (atan2(xs - yc, xc + ys), b, atan2(zc - ws, wc + zs), xc + ys, xs - yc),
            (atan2(-xs - yc, ys - xc), -b, atan2(zc + ws, zs - wc), ys - xc, -xs - yc),
        )

    def split(first: Row, second: Row, third: Row, free: Number) -> tuple[Turns, Turns, Number]:
        (q11, _, q13), (q21, _, q23), (q31, q32, q33) = first, second, third
        radius = hypot(q13, q23)
        if is_scalar and radius > DISTINCT and abs(q33 - cosines) < bound:
            return *distinct(q13, q23, q31, q32, q33), radius
        half = 0.5 * atan2(radius, q33)
        sine = root(sign * sin(total + half) * sin(total - half))
        cosine = root(sign * sin(half + rest) * sin(half - rest))
        turns = []
        for signed in (sine, -sine):
            b = 2.0 * atan2(signed, cosine)
            cb, sb = cos(b), sin(b)

            def left(ca: Number, sa: Number, cb: Number = cb, sb: Number = sb) -> Number:
                x, y = ca * q11 + sa * q21, ca * q21 - sa * q11
                y, z = c * y + s * q31, c * q31 - s * y
                x, y = cb * x + sb * y, cb * y - sb * x
                return atan2(c2 * y + s2 * z, x)

            a = atan2(q23, q13) - atan2(-c * s2 * cb - s * c2, s2 * sb)
            free_turn = _first(f, q33, left(1.0, 0.0), free) if frees_last else free
            a = f.where_free(radius <= FREE, free_turn, a)
            turns.append((a, b, left(cos(a), sin(a)), cos(a), sin(a)))
        return turns[0], turns[1], radius

    return split


def _first(f: Operations, q33: Number, total: Number, last: Number) -> Number:
    """Return the first of two turns about axes in line; ``total`` is the ``last`` without it."""
    return f.select(q33 > 0.0, total - last, last - total)


def _square_turns(
    f: Operations, s: float, s2: float, *, frees_last: bool
) -> Callable[[Row, Row, Row, Number], tuple[Turns, Turns, Number]]:
    """Return `three_turns` for twists of a quarter turn, with sines ``s`` and ``s2``.

    The last column of Q is then (s2 cos a sin b, s2 sin a sin b, -s s2 cos b), and its last row
    begins with s sin b (cos c, -sin c). Where sin b is small, c follows from what Rz(-a) leaves of
    Q: its second row is -s s2 (sin c, cos c, 0).
    """
    atan2, hypot, where_free, cos, sin = f.atan2, f.hypot, f.where_free, f.cos, f.sin
    sign, pi, is_scalar = -s * s2, math.pi, f.is_scalar

    def split(first: Row, second: Row, third: Row, free: Number) -> tuple[Turns, Turns, Number]:
        (q11, q12, q13), (q21, q22, q23), (q31, q32, q33) = first, second, third
        radius = hypot(q13, q23)
        if is_scalar and radius > DISTINCT:
            a, c = atan2(s2 * q23, s2 * q13), atan2(-s * q32, s * q31)
            ca, sa = s2 * q13 / radius, s2 * q23 / radius
        else:

            def left(ca: Number, sa: Number) -> Number:
                return atan2(sign * (ca * q21 - sa * q11), sign * (ca * q22 - sa * q12))

            is_free = radius <= FREE
            free_turn = _first(f, q33, left(1.0, 0.0), free) if frees_last else free
            # Of a direction any length gives the angles.
            x = where_free(is_free, cos(free_turn), s2 * q13)
            y = where_free(is_free, sin(free_turn), s2 * q23)
            length = where_free(is_free, 1.0, radius)
            a, c, ca, sa = atan2(y, x), left(x, y), x / length, y / length
        b = atan2(radius, sign * q33)
        return (a, b, c, ca, sa), (a + pi, -b, c + pi, -ca, -sa), radius

    return split
