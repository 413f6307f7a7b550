"""The Paden-Kahan subproblems: a rotation about one axis, solved by geometry.

Axes are given by a unit direction `omega` and a point `r` [m] on them, of any orientation. Angles
are in rad, in (-pi, pi]. If no exact angle exists, the angle of the smallest misfit is returned
with `exact` False. Every angle is an atan2: an arccos loses half its digits where its argument
nears 1.

Sources: Paden (1986); Murray, Li & Sastry (1994), ch. 3.2.2 (subproblems 1 and 3). Subproblem 4 is
the part of the second that remains for an arm whose first joint alone turns its plane.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from katana450 import tolerances
from katana450.maths.kinematics.turns import wrapped
from katana450.maths.water.vectors import Vector, norm, scale, sub

EXACT = 1e-9
"""[m, or the unit of the plane's d] Misfit up to which an answer counts as exact."""


@dataclass(frozen=True, slots=True)
class Rotations:
    """All angles [rad] that solve a subproblem in one angle.

    Attributes:
        angles: the solutions.
        exact: True if the equation holds, to rounding; otherwise the angles have the smallest
            misfit.
        free: True in the ill-posed case: every angle is as good as the given one.
    """

    angles: tuple[float, ...]
    exact: bool
    free: bool = False


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product of `a` and `b`."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _perpendicular(a: Vector, omega: Vector) -> Vector:
    """Return the part of `a` perpendicular to the unit vector `omega`."""
    return sub(a, scale(dot(a, omega), omega))


def _sqrt(radicand: float) -> float:
    return math.sqrt(radicand) if radicand > 0.0 else 0.0


def subproblem1(omega: Vector, r: Vector, p: Vector, q: Vector) -> Rotations:
    """Turn p onto q:  exp(omega theta) p = q.

    One solution. If p and q differ in height along the axis or in distance from it, there is no
    exact solution, and the angle brings p nearest to q. Ill-posed with p or q on the axis: every
    angle is a solution, and 0 is returned. Murray, Li & Sastry, subproblem 1.
    """
    u, v = sub(p, r), sub(q, r)
    height = dot(omega, sub(u, v))
    u, v = _perpendicular(u, omega), _perpendicular(v, omega)
    radius_u, radius_v = norm(u), norm(v)
    misfit = math.hypot(height, radius_u - radius_v)
    exact = misfit <= EXACT
    if min(radius_u, radius_v) <= tolerances.ON_AXIS:
        return Rotations((0.0,), exact, free=True)
    return Rotations((wrapped(math.atan2(dot(omega, cross(u, v)), dot(u, v))),), exact)


def subproblem3(omega: Vector, r: Vector, p: Vector, q: Vector, delta: float) -> Rotations:
    """Turn p to the distance `delta` [m] from q:  |q - exp(omega theta) p| = delta.

    Two solutions, which coincide where the circle of p touches the sphere round q. Without an exact
    solution, the single angle of the nearest distance. Ill-posed with p or q on the axis: the
    distance is the same at every angle, and 0 is returned. Murray, Li & Sastry, subproblem 3. The
    angle between the two arms u, v of the triangle is
    2 atan2(sqrt(delta^2 - (u-v)^2), sqrt((u+v)^2 - delta^2)). Its differences of squares are
    factored, which keeps the digits when the arm is stretched or folded.
    """
    u, v = sub(p, r), sub(q, r)
    height = dot(omega, sub(u, v))
    u, v = _perpendicular(u, omega), _perpendicular(v, omega)
    radius_u, radius_v = norm(u), norm(v)
    in_plane = _sqrt((delta - height) * (delta + height))
    near, far = abs(radius_u - radius_v), radius_u + radius_v
    if min(radius_u, radius_v) <= tolerances.ON_AXIS:
        misfit = abs(math.hypot(height, far) - delta)
        return Rotations((0.0,), misfit <= EXACT, free=True)
    middle = math.atan2(dot(omega, cross(u, v)), dot(u, v))
    folded = (in_plane - near) * (in_plane + near)
    stretched = (far - in_plane) * (far + in_plane)
    opening = 2.0 * math.atan2(_sqrt(folded), _sqrt(stretched))
    rounding = -tolerances.RADICAND * far * far
    if abs(height) > delta + EXACT or min(folded, stretched) < rounding:
        return Rotations((wrapped(middle + opening),), exact=False)
    return Rotations((wrapped(middle + opening), wrapped(middle - opening)), exact=True)


def subproblem4(omega: Vector, r: Vector, p: Vector, h: Vector, d: float) -> Rotations:
    """Turn p into the plane with unit normal h at the offset d [m]:  h . exp(omega theta) p = d.

    Two solutions, which coincide where the circle of p touches the plane. Without an exact
    solution, the single angle that brings p nearest to the plane. Ill-posed with p on the axis, or
    with the plane perpendicular to it: the offset is the same at every angle, and 0 is returned.
    With u = p - r the condition is a sin(theta) + b cos(theta) = c,  a = h . (omega x u),  b = h .
    u_perpendicular.
    """
    u = sub(p, r)
    c = d - dot(h, r) - dot(omega, u) * dot(omega, h)
    u = _perpendicular(u, omega)
    a, b = dot(h, cross(omega, u)), dot(h, u)
    amplitude = math.hypot(a, b)
    if amplitude <= tolerances.ON_AXIS:
        return Rotations((0.0,), abs(c) <= EXACT, free=True)
    middle = math.atan2(a, b)
    opening = 2.0 * math.atan2(_sqrt(amplitude - c), _sqrt(amplitude + c))
    if abs(c) > amplitude * (1.0 + tolerances.RADICAND):
        return Rotations((wrapped(middle + opening),), exact=False)
    return Rotations((wrapped(middle + opening), wrapped(middle - opening)), exact=True)
