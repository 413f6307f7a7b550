"""The closed form of the canonical arm, for floats and for arrays.

Each step is a Paden-Kahan subproblem (tests/kinematics/subproblems.py) written out for axes along
z, y, y, y and x, where it needs no vectors. The tool frame {K} is at p, its axes are the columns
of R:

    alpha1   p lies in the arm's plane, d beside axis 1: subproblem 4, the paper's (12) to (14) with
             atan2; 2 solutions, facing p and facing away from it.
    phi      the tool's x axis lies in that plane: subproblem 1 about the y axis; 1 solution. The
             wrist is then w = p - l3 (cos phi, sin phi) in the plane, the point of (19).
    alpha3   |w| from the shoulder: subproblem 3, (15) to (18); 2 solutions, elbow up and down.
    alpha2   the bent arm turns onto w: subproblem 1, (19) to (21); 1 solution.
    alpha4   the remainder of phi, subproblem 1, (22) to (26); 1 solution.
    alpha5   the tool's y axis: subproblem 1, (27) to (29); 1 solution.

In the plane u points outward from axis 1 and v down, so that alpha2 to alpha4 turn u towards v.
Every angle is an atan2 of sides, and differences of squares are factored: no digits are lost where
the arm is stretched or folded, or the tool upright. A wrist out of reach is replaced by the one at
the nearest distance in reach, and an x axis out of the plane by its nearest pitch and roll. Every
pose therefore has an answer; exact poses are not changed by this.

An arm with a = d = tilt = 0 is its own mirror image: half a turn about axis 1 gives the postures
that face away from p from those that face it. alpha5 is also turned by pi, and the angles in the
plane are mirrored: alpha2 to pi - alpha2, alpha3 and alpha4 to their negatives, elbow up to elbow
down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from katana450.maths.kinematics.arm import FiveAxisArm

# A float or an array: the formulas are the same.
Number = Any


class Functions(NamedTuple):
    """The functions of `math` or of numpy that the formulas use.

    Attributes:
        atan2, sqrt: as in `math`.
        root: sqrt(x), and 0 where x < 0.
        direction: (y, x) to atan2(y, x), its cosine and its sine.
    """

    atan2: Callable[[Number, Number], Number]
    sqrt: Callable[[Number], Number]
    root: Callable[[Number], Number]
    direction: Callable[[Number, Number], tuple[Number, Number, Number]]


Posture = tuple[Number, Number, Number, Number, Number]


def closed_form(arm: FiveAxisArm, functions: Functions) -> Callable[..., Posture]:
    """Return a function for all steps of `arm` but the first; its lengths are bound once.

    The function is posture(c, s, u, rows of T_C_K): (phi, alpha2 with the elbow up, alpha2 with the
    elbow down, alpha3 with the elbow up, alpha5). c, s are cos and sin of alpha1, and u is the
    outward distance of p in the plane. alpha2 is in [-2 pi, 2 pi], alpha3 in [0, pi], alpha5 in
    [-pi, pi].
    """
    atan2, sqrt, root, direction = functions
    a, tilt, mirrored = arm.a, arm.tilt, arm.is_mirrored
    far, near = arm.l1 + arm.l2, abs(arm.l1 - arm.l2)
    squares = (arm.l1 - arm.l2) * far
    along, below = arm.l3 * math.cos(tilt), arm.l3 * math.sin(tilt)

    def posture(c: Number, s: Number, u: Number, rows: Sequence[Sequence[Number]]) -> Posture:
        (r11, r12, r13, _), (r21, r22, r23, _), (r31, r32, r33, z), _ = rows
        pitch, cp, sp = direction(-r31, c * r11 + s * r21)
        # The tool's y and z axes along the perpendicular of its x axis in the plane.
        roll = atan2(sp * (c * r12 + s * r22) + cp * r32, sp * (c * r13 + s * r23) + cp * r33)
        # The wrist from the shoulder.
        if mirrored:
            u, v, phi = u - along * cp, -z - along * sp, pitch
        else:
            u, v = u - a - along * cp + below * sp, -z - along * sp - below * cp
            phi = pitch + tilt
        square = u * u + v * v
        rho = sqrt(square)
        # By the law of cosines 2 l1 l2 (1 -+ cos alpha3); out of reach one of them is negative.
        stretched, folded = (far - rho) * (far + rho), (rho - near) * (rho + near)
        sine = root(stretched * folded)
        towards = atan2(v, u)
        # The angle between the upper arm and the line from shoulder to wrist.
        wrist_angle = atan2(sine, square + squares)
        bend = atan2(2.0 * sine, folded - stretched)
        return phi, towards - wrist_angle, towards + wrist_angle, bend, roll

    return posture
