"""The closed forms of arms whose axes 2, 3 and 4 are parallel: six axes (UR), or four.

The parallel axes move the tool in a plane that axis 1 turns. With the frames of links.py:

    alpha1   the height along axes 2 to 4 of a point that no later joint lifts: subproblem 4; 2
             solutions, facing it and facing away from it.
    psi      the sum of alpha2 to alpha4, with the signs of the axes; see below.
    alpha3   the distance of axis 4 from axis 2: subproblem 3; 2 solutions, elbow up and down.
    alpha2   the bent arm turns onto axis 4: subproblem 1; 1 solution.
    alpha4   the remainder of psi.

Six axes, of which 5 and 6 meet (`six_axes`). The point is where they meet. psi, alpha5 and alpha6
split what remains of the tool's rotation (`three_turns`): subproblem 4 with 2 solutions, and
subproblem 1 twice. There are 8 branches. With axes 4 and 6 parallel only psi and alpha6 together
count: alpha6 is free.

Four axes (`four_axes`). The point is the tool point, and psi is the turn that brings the line from
axis 4 to the tool point nearest to its direction in the pose: subproblem 1, 1 solution. There are 4
branches. Four axes take a pose with one shoulder only. The postures of the other shoulder hold the
tool point but not the rotation, and so does every posture for a pose that is turned out of the
plane. Near axis 1 the tool point determines alpha1 poorly; the direction of the axes 2 to 4 in the
pose then determines it, if both agree.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator

import numpy as np

from katana450 import tolerances
from katana450.extensions.general_arms.functions import (
    FLOATS,
    FREE,
    Number,
    Operations,
    facing,
    three_turns,
    two_links,
)
from katana450.extensions.general_arms.links import DHLinks, sine_and_cosine
from katana450.extensions.general_arms.spherical_wrist import Angles, Solve
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import frozen
from katana450.maths.kinematics.turns import wrapped

LOOSE = 1e-3
"""[1] Sine of the angle between axes 4 and 6 below which rounding may put axis 4 out of reach by
more than 1e-12 m. psi is then turned back, as far as that turns the tool by less than HELD."""

HELD = 9e-13
"""[rad] Turn of the tool that counts as rounding where two singularities are near. To it comes
several times the rounding of the arm's file, which `FileRounding` then corrects."""

AGREES = 1e-13
"""[m] Distance of the tool point from the arm's plane up to which pose and plane agree."""


def six_axes(links: DHLinks, f: Operations) -> Solve:
    """Return solve(rows, free) for six axes; as `spherical_wrist.parallel_shoulder`."""
    (s1, c1), (s4, c4) = sine_and_cosine(links.t[0]), sine_and_cosine(links.t[3])
    (_, flip2), (_, flip3) = sine_and_cosine(links.t[1]), sine_and_cosine(links.t[2])
    flip = flip2 * flip3
    d5, a1, d1 = links.d[4], links.a[0], links.d[0]
    height = links.d[1] + flip2 * (links.d[2] + flip3 * (links.d[3] + c4 * d5))
    ex, ey = links.a[3], -flip * s4 * d5
    turns, bent = facing(f), two_links(f, links.a[1], links.a[2])
    t4 = links.t[3] + (0.0 if flip > 0.0 else math.pi)
    split = three_turns(f, t4, links.t[4], frees_last=True)
    held = HELD + 4.0 * links.rounding[0]
    loosened = _loosened(links.a[1], links.a[2], ex, ey, held)
    atan2 = f.atan2

    def solve(rows: list[list[Number]], free: Angles) -> Iterator[Angles]:
        (r11, r12, r13, x), (r21, r22, r23, y), (r31, r32, r33, z), _ = rows
        z = z - d1
        offset = (c1 * z - height) / s1
        up = c1 * offset + s1 * z
        for c, s, length in turns(x, y, offset, free[0]):
            one = atan2(s, c)
            m11, m12, m13 = c * r11 + s * r21, c * r12 + s * r22, c * r13 + s * r23
            m31, m32, m33 = c * r21 - s * r11, c * r22 - s * r12, c * r23 - s * r13
            m21, m22, m23 = c1 * m31 + s1 * r31, c1 * m32 + s1 * r32, c1 * m33 + s1 * r33
            m31, m32, m33 = c1 * r31 - s1 * m31, c1 * r32 - s1 * m32, c1 * r33 - s1 * m33
            first, second, radius = split(
                (m11, m12, m13), (m21, m22, m23), (m31, m32, m33), free[5]
            )
            u, v = length - a1, up
            for psi, five, six, cp, sp in (first, second):
                wx, wy = u - ex * cp + ey * sp, v - ex * sp - ey * cp
                towards, opening, bend, square = bent(wx, wy)
                if f.is_scalar and radius <= LOOSE:
                    moved = radius * f.sin(0.5 * (six - free[5]))
                    # Up to FREE alpha6 has the wanted angle already.
                    if square <= 0.0 or (radius > FREE and abs(moved) <= 0.5 * held):
                        side = -radius if m33 < 0.0 else radius
                        psi, six, towards, opening, bend = loosened(  # noqa: PLW2901
                            u, v, wx, wy, psi, six, free[5], side
                        )
                for two, bend_ in ((towards - opening, bend), (towards + opening, -bend)):
                    four = flip * (psi - two - bend_)
                    yield one, two, flip2 * bend_, four, five, six

    return solve


def _loosened(
    l1: float, l2: float, ex: float, ey: float, held: float
) -> Callable[..., tuple[float, ...]]:
    """Return a function for psi and alpha6 [rad] where axes 4 and 6 are nearly in line.

    Of all turns that keep their sum, or difference, and turn the tool by less than ``held``, it
    takes the one with alpha6 at the wanted angle, else the given one, and of these the nearest that
    keeps axis 4 in reach. Axis 4 lies at (u, v) less (ex, ey) turned by psi, and must be l1 - l2 to
    l1 + l2 away: the law of cosines gives the angle between the two vectors there, subproblem 3.
    ``radius`` is the sine of the angle between the two axes, and negative if they are opposed. The
    function also returns the angles of `two_links`, which are stretched or folded there.
    """
    bent = two_links(FLOATS, l1, l2)
    e, start = math.hypot(ex, ey), math.atan2(ey, ex)
    far, near = (l1 + l2) ** 2, (l1 - l2) ** 2
    stretched, folded = (0.0, 0.0), (0.0 if l1 >= l2 else math.pi, math.pi)

    def loosened(
        u: float,
        v: float,
        wx: float,
        wy: float,
        psi: float,
        six: float,
        free: float,
        radius: float,
    ) -> tuple[float, ...]:
        side, radius = math.copysign(1.0, radius), abs(radius)
        turn = 0.0 if radius <= FREE else math.remainder(six - free, math.tau)
        if turn and radius * abs(turn) <= held:
            psi, six = psi + side * turn, six - turn
            c, s = math.cos(psi), math.sin(psi)
            wx, wy = u - ex * c + ey * s, v - ex * s - ey * c
        square = wx * wx + wy * wy
        if near < square < far:
            return wrapped(psi), wrapped(six), *bent(wx, wy)[:3]
        g = math.hypot(u, v)
        if e * g > FREE:
            away = math.remainder(psi - math.atan2(v, u) + start, math.tau)
            cosine = 0.5 * (g * g + e * e - (far if square >= far else near)) / (e * g)
            angle = math.acos(-1.0 if cosine < -1.0 else 1.0 if cosine > 1.0 else cosine)
            turn = (angle if away >= 0.0 else -angle) - away
            if radius <= FREE or radius * abs(turn) <= held:
                psi, six = psi + turn, six - side * turn
                c, s = math.cos(psi), math.sin(psi)
                wx, wy = u - ex * c + ey * s, v - ex * s - ey * c
        bend = stretched if square >= far else folded
        return wrapped(psi), wrapped(six), math.atan2(wy, wx), *bend

    return loosened


def four_axes(links: DHLinks, f: Operations) -> Solve:
    """Return solve(rows, free) for four axes, whose links are `pointed`.

    ``rows`` is the pose of the tool point with the rotation of the last frame. The 4 solutions are
    the canonical angles [rad]; as `spherical_wrist.parallel_shoulder`.
    """
    s1, c1 = sine_and_cosine(links.t[0])
    (_, flip2), (_, flip3) = sine_and_cosine(links.t[1]), sine_and_cosine(links.t[2])
    flip = flip2 * flip3
    a1, d1 = links.a[0], links.d[0]
    length, _, over = links.T_n_tool[:3, 3].tolist()
    height = links.d[1] + flip2 * (links.d[2] + flip3 * over)
    turns, bent = facing(f), two_links(f, links.a[1], links.a[2])
    near = tolerances.NEAR_AXIS_1 * links.reach
    atan2, hypot, cos, sin = f.atan2, f.hypot, f.cos, f.sin

    def solve(rows: list[list[Number]], free: Angles) -> Iterator[Angles]:
        (r11, _, r13, x), (r21, _, r23, y), (r31, _, _, z), _ = rows
        z = z - d1
        offset = (c1 * z - height) / s1
        up = c1 * offset + s1 * z
        front, back = turns(x, y, offset, free[0])
        along = -flip * s1 * r23, flip * s1 * r13
        planes: Angles = (*front, *back)
        if f.is_scalar and front[2] <= near:
            planes = _by_axes(*planes, x, y, offset, *along)
        for c, s, outward in (planes[:3], planes[3:]):
            one = atan2(s, c)
            m11, m21 = c * r11 + s * r21, c1 * (c * r21 - s * r11) + s1 * r31
            psi = f.select(hypot(m11, m21) <= FREE, 0.0, atan2(m21, m11))
            u, v = outward - a1 - length * cos(psi), up - length * sin(psi)
            towards, opening, bend, _ = bent(u, v)
            for two, bend_ in ((towards - opening, bend), (towards + opening, -bend)):
                yield one, two, flip2 * bend_, flip * (psi - two - bend_)

    return solve


def _by_axes(*numbers: float) -> tuple[float, ...]:
    """Return the turns of axis 1, one of them along (c, s) if that holds the tool point too.

    numbers: the two turns, (cos, sin, x') each; x, y and height of the tool point; c and s.
    """
    front, back, (x, y, offset, c, s) = numbers[:3], numbers[3:6], numbers[6:]
    size = math.hypot(c, s)
    if size <= FREE:
        return front + back
    c, s = c / size, s / size
    if abs(c * y - s * x - offset) > AGREES:
        return front + back
    along = c, s, c * x + s * y
    if c * front[0] + s * front[1] >= c * back[0] + s * back[1]:
        return along + back
    return front + along


def pointed(links: DHLinks) -> DHLinks:
    """Return the links of four axes with alpha4 = 0 where x points to the tool point."""
    x, y, z = links.T_n_tool[:3, 3].tolist()
    bearing = math.atan2(y, x) if math.hypot(x, y) > tolerances.FAMILY_LENGTH else 0.0
    length = math.hypot(x, y)
    R = so3.rotation_z(-bearing) @ links.T_n_tool[:3, :3]
    return dataclasses.replace(
        links,
        shift=(*links.shift[:3], links.shift[3] + bearing),
        T_n_tool=frozen(se3.from_rotation_translation(R, np.array([length, 0.0, z]))),
    )


def why_not_parallel(links: DHLinks) -> str:
    """Return the condition on parallel axes that four or six axes miss; empty if all hold."""
    for i in (2, 3):
        if not links.is_parallel(i):
            turn = math.degrees(min(abs(links.t[i - 1]), math.pi - abs(links.t[i - 1])))
            return f"axes {i} and {i + 1} are not parallel ({turn:.3g} deg off)"
    if links.is_parallel(1):
        return "axis 1 is parallel to axis 2"
    for i in (2, 3):
        if links.a[i - 1] == 0.0:
            return f"axes {i} and {i + 1} are one line"
    if links.n == 6 and not links.crosses(5):
        return "axes 5 and 6 do not meet"
    return "axes 4 and 5 are parallel" if links.n == 6 and links.is_parallel(4) else ""
