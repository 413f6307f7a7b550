"""Inverse kinematics of one pose in closed form, on plain floats: microseconds for all branches.

`inverse` checks its arguments, and `Solver` is for loops. Both follow the paper's eq. (12) to (29)
for both shoulders and both elbows. The module maths/kinematics/closed_form.py lists the steps, each
with its subproblem and number of solutions.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache, partial
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.maths.geometry import se3
from katana450.maths.geometry.se3 import Rows
from katana450.maths.kinematics.arm import Five, FiveAxisArm, arm_of
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.closed_form import Functions, closed_form
from katana450.maths.kinematics.solution import Slack, Solutions
from katana450.maths.kinematics.turns import in_turn, nearest_turn, wrapped

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
