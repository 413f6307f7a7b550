"""The closed form of the canonical arm, once, for floats and for arrays.

Each step is a Paden-Kahan subproblem (app/kinematics/subproblems.py) written out for axes along z,
y, y, y and x, where it needs no vectors. With the tool frame {K} at p, its axes the columns of R:

    alpha1   p lies in the arm's plane, d beside axis 1: subproblem 4, the paper's (12) to (14) with
             atan2; 2 solutions, facing p and with the back to it.
    phi      the tool's x axis lies in that plane: subproblem 1 about the y axis; 1 solution. The
             wrist is then w = p - l3 (cos phi, sin phi) in the plane, the point (19) is true for.
    alpha3   |w| from the shoulder: subproblem 3, (15) to (18); 2 solutions, elbow up and down.
    alpha2   the bent arm turns onto w: subproblem 1, (19) to (21); 1 solution.
    alpha4   what is left of phi, subproblem 1, (22) to (26); 1 solution.
    alpha5   the tool's y axis: subproblem 1, (27) to (29); 1 solution.

In the plane u points outward from axis 1 and v down, so that alpha2 to alpha4 turn u towards v.
Every angle is an atan2 of sides, and differences of squares are factored: no digits are lost where
the arm is stretched, folded, or the tool upright. A wrist out of reach is taken at the nearest
distance that is in reach, an x axis out of the plane at its nearest pitch and roll, so every pose
has an answer; on exact poses nothing of that shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from app.kinematics.arm import FiveAxisArm

# float -> float, or array -> array: the formulas are the same.
Number = Any


class Functions(NamedTuple):
    """What the formulas need of `math` or of numpy.

    distance(u, v, near, far): that of (u, v) from the origin, or the nearest to it in [near, far].
    """

    atan2: Callable[[Number, Number], Number]
    sqrt: Callable[[Number], Number]
    sin: Callable[[Number], Number]
    cos: Callable[[Number], Number]
    distance: Callable[[Number, Number, float, float], Number]


class ClosedForm(NamedTuple):
    """The steps for one arm.

    orient(c, s, rows of T_C_K): (phi, alpha5, l3 cos phi, l3 sin phi), and the last two as they are
    for the opposite plane, with c, s = cos, sin alpha1. reach(u, v): (alpha2 with the elbow up,
    down, alpha3 with the elbow up) for the wrist at (u, v) from the shoulder.
    """

    orient: Callable[..., tuple[Number, Number, Number, Number, Number, Number]]
    reach: Callable[[Number, Number], tuple[Number, Number, Number]]


def closed_form(arm: FiveAxisArm, functions: Functions) -> ClosedForm:
    """The steps for `arm`, its lengths bound once."""
    atan2, sqrt, sin, cos, distance = functions
    far, near = arm.l1 + arm.l2, abs(arm.l1 - arm.l2)
    squares = (arm.l1 - arm.l2) * far
    tilt = arm.tilt
    ahead, below = arm.l3 * math.cos(tilt), arm.l3 * math.sin(tilt)

    def orient(
        c: Number, s: Number, rows: Sequence[Sequence[Number]]
    ) -> tuple[Number, Number, Number, Number, Number, Number]:
        (r11, r12, r13, _), (r21, r22, r23, _), (r31, r32, r33, _), _ = rows
        pitch = atan2(-r31, c * r11 + s * r21)
        cp, sp = cos(pitch), sin(pitch)
        roll = atan2(
            sp * (c * r12 + s * r22) + cp * r32 - c * r23 + s * r13,
            sp * (c * r13 + s * r23) + cp * r33 + c * r22 - s * r12,
        )
        ac, bs, as_, bc = ahead * cp, below * sp, ahead * sp, below * cp
        return pitch + tilt, roll, ac - bs, as_ + bc, -ac - bs, as_ - bc

    def reach(u: Number, v: Number) -> tuple[Number, Number, Number]:
        rho = distance(u, v, near, far)
        stretched = sqrt((far - rho) * (far + rho))
        folded = sqrt((rho - near) * (rho + near))
        towards = atan2(v, u)
        # The angle between upper arm and shoulder-wrist line, by the law of cosines.
        beside = atan2(stretched * folded, rho * rho + squares)
        return towards - beside, towards + beside, 2.0 * atan2(stretched, folded)

    return ClosedForm(orient, reach)
