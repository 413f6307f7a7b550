"""Inverse kinematics of one pose in closed form, on plain floats: microseconds for all branches.

`inverse` checks its arguments, and `Solver` is for loops. Both follow the paper's eq. (12) to (29)
for both shoulders and both elbows. `closed_form` has the steps, for floats and for arrays.

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
from functools import lru_cache, partial
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.maths.geometry import se3
from katana450.maths.geometry.se3 import Rows
from katana450.maths.kinematics.arm import Five, FiveAxisArm, arm_of
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.solution import Slack, Solutions
from katana450.maths.kinematics.turns import in_turn, nearest_turn, wrapped

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


FourBranches = tuple[Five, Five, Five, Five]


def _root(x: float) -> float:
    return math.sqrt(x) if x > 0.0 else 0.0


def _direction(y: float, x: float) -> tuple[float, float, float]:
    angle = math.atan2(y, x)
    return angle, math.cos(angle), math.sin(angle)


_FLOATS: Final = Functions(math.atan2, math.sqrt, _root, _direction)


class Solver(NamedTuple):
    """Inverse kinematics of one chain without checks, for loops over many poses.

    Attributes:
        arm: the canonical arm.
        solve: solve(rows, theta1=0.0). `rows` is T.tolist() of a pose T_S_tool (4, 4) [m] with
            orthonormal rotation. `theta1` [rad] is used where the pose leaves it free. Returns
            joint angles [rad] in the order of BRANCHES, each in the turn inside its limits if there
            is one, else in [-pi, pi].
        slack: returns the errors of a pose that rounding explains, see `Solution`.
    """

    arm: FiveAxisArm
    solve: Callable[..., FourBranches]
    slack: Slack

    @staticmethod
    @lru_cache(maxsize=64)
    def of(chain: Chain) -> Solver:
        """Return the solver of `chain`; the result is cached.

        Raises RobotDescriptionError as `arm_of`.
        """
        arm = arm_of(chain)
        return Solver(arm, _solve(chain, arm), partial(_rounding, arm))


def _rounding(arm: FiveAxisArm, T: npt.ArrayLike) -> tuple[float, float]:
    """Return the errors [m], [rad] of a pose `T` (4, 4) that rounding in the arm's file explains.

    Each of four axes may be off by `skew`, and so displaces the parts on it by a `length`. theta1
    follows from a point sqrt(rho^2 - d^2) outward of axis 1. A displacement by the length turns
    theta1 by its ratio to this distance; nearer than the length theta1 is undetermined. A tool
    point beside the roll axis turns with it.
    """
    length = 4.0 * (arm.skew * arm.reach + arm.gap)
    if length == 0.0:
        return 0.0, 0.0
    x, y = arm.pose(np.array(T))[:2, 3].tolist()
    rho, d = math.hypot(x, y), abs(arm.d)
    outward = math.sqrt(abs(rho - d) * (rho + d) + length * (length + 2.0 * d))
    turn = 4.0 * arm.skew + length / outward
    return length + turn * arm.off_axis, turn


Facing = tuple[float, float, float, float, float, float, float, float]


def facing_near_axis_1(
    arm: FiveAxisArm, x: float, y: float, r11: float, r21: float, free: float
) -> Facing:
    """Return (alpha1, cos, sin, u) facing the tool point at (x, y), then facing away from it.

    Valid everywhere, but meant for a tool point near axis 1, or near the cylinder of radius d about
    it, which no tool point enters. There the place of the tool point determines alpha1 poorly. The
    direction of the tool's x axis (r11, r21) determines it better, if it agrees or is the longer of
    the two. With the tool upright on axis 1, neither determines alpha1: it is then `free`.
    """
    d, rounding = arm.d, 2.0 * tolerances.ROUNDING * arm.reach
    rho, flat = math.hypot(x, y), math.hypot(r11, r21)
    if flat > tolerances.UPRIGHT:
        c, s = r11 / flat, r21 / flat
        if abs(c * y - s * x + d) < abs(c * y - s * x - d):
            c, s = -c, -s
        trusted = rho <= min(tolerances.ON_AXIS, flat * arm.reach)
        if trusted or abs(c * y - s * x - d) <= rounding:
            u = c * x + s * y
            front, back = (c, s, u), _opposite(d, x, y, rho, c, s, u)
            if u < -rounding:
                front, back = back, front
            return _with_angle(*front) + _with_angle(*back)
    elif rho <= 0.5 * rounding:
        free = wrapped(free)
        c, s = math.cos(free), math.sin(free)
        return free, c, s, 0.0, wrapped(free + math.pi), -c, -s, 0.0
    sine = min(max(d / rho, -1.0), 1.0)
    cosine = math.sqrt((1.0 - sine) * (1.0 + sine))
    x, y = x / rho, y / rho
    return _with_angle(x * cosine + y * sine, y * cosine - x * sine, rho * cosine) + _with_angle(
        y * sine - x * cosine, -y * cosine - x * sine, -rho * cosine
    )


def _opposite(
    d: float, x: float, y: float, rho: float, c: float, s: float, u: float
) -> tuple[float, float, float]:
    """Return the other plane at the distance d from axis 1 that holds the tool point."""
    if d == 0.0 or rho <= tolerances.ON_AXIS:
        return -c, -s, -u
    c, s = d * y - u * x, -d * x - u * y
    scale = 1.0 / math.hypot(c, s)
    return c * scale, s * scale, -u


def _with_angle(c: float, s: float, u: float) -> tuple[float, float, float, float]:
    return math.atan2(s, c), c, s, u


def _solve(chain: Chain, arm: FiveAxisArm) -> Callable[..., FourBranches]:
    posture = closed_form(arm, _FLOATS)
    in_line = arm.d == 0.0
    near = tolerances.NEAR_AXIS_1 * arm.reach
    atan2, hypot, remainder = math.atan2, math.hypot, math.remainder
    pi, start, tau = math.pi, -math.pi, math.tau
    turned = _turned(chain, arm)
    is_canonical, is_mirrored, pose = arm.is_canonical, arm.is_mirrored, arm.pose

    def solve(rows: Rows, theta1: float = 0.0) -> FourBranches:
        if not is_canonical:
            rows = pose(np.array(rows)).tolist()
            theta1 *= arm.signs[0]
        x, y = rows[0][3], rows[1][3]
        u = hypot(x, y)
        if in_line and u > near:
            one, c, s = atan2(y, x), x / u, y / u
            other = one - pi if one > 0.0 else one + pi
        else:
            r11, r21 = rows[0][0], rows[1][0]
            one, c, s, u, other, c2, s2, u2 = facing_near_axis_1(arm, x, y, r11, r21, theta1)
        phi, up, down, bend, five = posture(c, s, u, rows)
        if up < start:
            up += tau
        if down > pi:
            down -= tau
        a4, b4 = phi - up - bend, phi - down + bend
        if not start <= a4 <= pi:
            a4 = remainder(a4, tau)
        if not start <= b4 <= pi:
            b4 = remainder(b4, tau)
        if is_mirrored:
            up2 = pi - down if down > 0.0 else start - down
            down2 = pi - up if up > 0.0 else start - up
            bend2, c4, d4 = bend, -b4, -a4
            five2 = five - pi if five > 0.0 else five + pi
        else:
            if in_line:
                c2, s2, u2 = -c, -s, -u
            phi2, up2, down2, bend2, five2 = posture(c2, s2, u2, rows)
            up2, down2 = remainder(up2, tau), remainder(down2, tau)
            c4, d4 = remainder(phi2 - up2 - bend2, tau), remainder(phi2 - down2 + bend2, tau)
        front_up, front_down = (one, up, bend, a4, five), (one, down, -bend, b4, five)
        back_up, back_down = (other, up2, bend2, c4, five2), (other, down2, -bend2, d4, five2)
        if turned is None:
            return front_up, front_down, back_up, back_down
        return turned(front_up), turned(front_down), turned(back_up), turned(back_down)

    return solve


def _turned(chain: Chain, arm: FiveAxisArm) -> Callable[[Five], Five] | None:
    """Return the map from canonical angles within a turn to joint angles.

    None means that the map is the identity.
    """
    lower, upper = chain.lower.tolist(), chain.upper.tolist()
    limits = tuple(zip(arm.signs, arm.shifts, lower, upper, strict=True))
    if all(limit[:2] == (1.0, 0.0) and max(-limit[2], limit[3]) <= math.pi for limit in limits):
        return None

    def turned(alpha: Five) -> Five:
        one, two, three, four, five = (
            in_turn(sign * (angle - shift), a, b)
            for angle, (sign, shift, a, b) in zip(alpha, limits, strict=True)
        )
        return one, two, three, four, five

    return turned


def inverse(chain: Chain, T: npt.ArrayLike, *, q_hint: npt.ArrayLike | None = None) -> Solutions:
    """Return the four solutions for the pose `T` (4, 4) = T_S_tool [m], in the order of BRANCHES.

    Two solutions coincide where their branches meet (arm stretched or folded, tool point on axis
    1).

    `T` should be a pose that five axes can take. For any other pose the solutions hold the tool
    point, or come nearest to it along each link, with the tool's roll axis nearest in the plane.
    Their errors give the difference. Where the arm's plane passes beside axis 1, only one shoulder
    can take a pose: the two solutions of the other shoulder miss its yaw.

    Each angle is in the turn that fits the limits if there is one, else in [-pi, pi]. Limits wider
    than a turn leave a choice: the turn nearest to `q_hint` (5,) [rad]. With tool point and roll
    axis both on axis 1, theta1 is free: it is then that of the hint, or 0.

    Raises InputError for an invalid `T` or `q_hint`, RobotDescriptionError for an arm outside the
    family. Source: the paper's eq. (12)-(29). For loops without checks: `Solver`.
    """
    solver = Solver.of(chain)
    rows = se3.validated_rows(T)
    if q_hint is None:
        return Solutions(chain, rows, solver.solve(rows), BRANCHES, solver.slack)
    hint = chain.check_q(q_hint)
    angles = nearest_turn(chain, np.array(solver.solve(rows, float(hint[0]))), hint)
    return Solutions(chain, rows, list(map(tuple, angles.tolist())), BRANCHES, solver.slack)
