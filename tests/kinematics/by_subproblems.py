"""The inverse of any member of the family by the Paden-Kahan subproblems on its screw axes.

This is the specification of the closed form. It uses no canonical arm, only axes and points, and
follows the paper's eq. (12) to (29) with both shoulders and both elbows.
"""

from __future__ import annotations

import math

import numpy as np

from katana450.maths.geometry import screws, se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.water.vectors import Vector, add, norm, scale, sub, vector
from tests.kinematics.subproblems import cross, dot, subproblem1, subproblem3, subproblem4

ORIGIN: Vector = (0.0, 0.0, 0.0)
Line = tuple[Vector, Vector]


def _foot(p: Vector, line: Line) -> Vector:
    """Return the point of the line nearest to `p`."""
    omega, r = line
    return add(r, scale(dot(sub(p, r), omega), omega))


def rotate(p: Vector, omega: Vector, r: Vector, theta: float) -> Vector:
    """Return `p` turned by `theta` [rad] about the axis through `r` along the unit `omega`."""
    u = sub(p, r)
    c, s = math.cos(theta), math.sin(theta)
    along = scale((1.0 - c) * dot(omega, u), omega)
    return add(r, add(scale(c, u), add(scale(s, cross(omega, u)), along)))


def solve(chain: Chain, T: FloatArray) -> list[FloatArray]:
    """Return the joint vectors (5,) [rad] for the pose `T`, on every branch, in no order."""
    lines: list[Line] = [
        (vector(chain.S[:3, i]), vector(screws.point_on(chain.S[:, i]))) for i in range(5)
    ]
    one, two, three, four, five = lines
    tool = _foot(vector(chain.M[:3, 3]), five)
    wrist = _foot(tool, four)
    shoulder = _foot(tool, two)
    G = T @ se3.inverse(chain.M)

    def moved(p: Vector) -> Vector:
        return vector(G[:3, :3] @ p + G[:3, 3])

    along = vector(G[:3, :3] @ five[0])
    solutions: list[FloatArray] = []
    backwards = scale(-1.0, one[0])
    turns = subproblem4(backwards, one[1], moved(tool), two[0], dot(two[0], tool))
    for theta1 in turns.angles:
        turned = rotate(moved(tool), *one, -theta1)
        direction = rotate(along, one[0], ORIGIN, -theta1)
        pitch = subproblem1(two[0], ORIGIN, five[0], direction).angles[0]
        w = add(turned, rotate(sub(wrist, tool), two[0], ORIGIN, pitch))
        bends = subproblem3(*three, wrist, shoulder, norm(sub(w, shoulder)))
        for theta3 in bends.angles if bends.exact else ():
            bent = rotate(wrist, *three, theta3)
            theta2 = subproblem1(*two, bent, w).angles[0]
            before = [(three, theta3), (two, theta2), (one, theta1)]
            theta4 = subproblem1(*four, tool, _undone(moved(tool), before)).angles[0]
            before = [(four, theta4), *before]
            aside = add(tool, four[0])
            theta5 = subproblem1(*five, aside, _undone(moved(aside), before)).angles[0]
            solutions.append(np.array([theta1, theta2, theta3, theta4, theta5]))
    return solutions


def _undone(p: Vector, turns: list[tuple[Line, float]]) -> Vector:
    """Return `p` with the turns about the lines undone, the last one first."""
    for line, theta in reversed(turns):
        p = rotate(p, *line, -theta)
    return p


def same(qa: FloatArray, qb: FloatArray, within: float) -> bool:
    """Return True if two joint vectors are equal up to whole turns."""
    return bool(np.abs(np.exp(1j * np.asarray(qa)) - np.exp(1j * np.asarray(qb))).max() < within)


def matched(a: list[FloatArray], b: list[FloatArray], within: float) -> bool:
    """Return True if `a` and `b` contain the same joint vectors, up to whole turns."""
    return all(any(same(x, y, within) for y in b) for x in a) and all(
        any(same(x, y, within) for x in a) for y in b
    )
