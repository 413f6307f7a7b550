"""The closed forms of six axes of which the last three meet in one point, the wrist's centre.

The wrist's centre does not move with axes 4 to 6. The first three axes bring it to its place w, and
the last three turn the tool (Pieper 1968). With the frames of links.py, where d4 and a3, d3, t3 put
the centre at c after axis 3, the position is one of two problems.

Axes 2 and 3 parallel (Puma, KUKA KR), `parallel_shoulder`:

    alpha1   the height of w along axes 2 and 3 is fixed: subproblem 4; 2 solutions, facing w and
             facing away from it.
    alpha3   the distance of w from axis 2: subproblem 3; 2 solutions, elbow up and down.
    alpha2   the bent arm turns onto w: subproblem 1; 1 solution.

Axes 1 and 2 meet (all arms whose shoulder turns about a point), `crossing_shoulder`:

    alpha3   the distance of w from the meeting point: subproblem 3; 2 solutions.
    alpha2   the height of w along axis 1: subproblem 4; 2 solutions.
    alpha1   the arm turns onto w: subproblem 1; 1 solution.

Both end in the wrist, `three_turns`: subproblem 4 for alpha5 with 2 solutions, subproblem 1 for
alpha4 and alpha6. There are 8 branches. Singular are w on axis 1 (alpha1 is free), the arm
stretched or folded (two branches coincide), and axes 4 and 6 in line (only their sum counts: alpha4
is free). Everything after a free angle is computed from what remains of the pose, so that it is
exact there and near there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from katana450.extensions.general_arms.functions import (
    FREE,
    Number,
    Operations,
    facing,
    three_turns,
    two_links,
)
from katana450.extensions.general_arms.links import DHLinks, sine_and_cosine
from katana450.maths.geometry.arrays import FloatArray

Angles = tuple[Number, ...]
Solve = Callable[..., Iterable[Angles]]


def wrist_centre(links: DHLinks) -> tuple[float, float, float]:
    """Return the centre of the wrist [m] in the frame of axis 3 after its turn."""
    s, c = sine_and_cosine(links.t[2])
    return links.a[2], -s * links.d[3], c * links.d[3] + links.d[2]


def parallel_shoulder(links: DHLinks, f: Operations) -> Solve:
    """Return solve(rows, free) for axes 2 and 3 parallel; the module's text lists the steps.

    ``rows`` is the pose of the last frame in the first, ``free`` (6,) the angles [rad] that are
    used where the pose leaves them free. The 8 solutions are the canonical angles [rad], each
    computed when it is taken.
    """
    (s1, c1), (_, flip) = sine_and_cosine(links.t[0]), sine_and_cosine(links.t[1])
    st, ct = sine_and_cosine(links.t[1] + links.t[2])
    cx, cy, cz = wrist_centre(links)
    a1, d1 = links.a[0], links.d[0]
    height = links.d[1] + flip * cz
    bearing = math.atan2(cy, cx)
    turns, bent = facing(f), two_links(f, links.a[1], math.hypot(cx, cy))
    split = three_turns(f, links.t[3], links.t[4])
    atan2, cos, sin = f.atan2, f.cos, f.sin
    offset = flip * bearing

    def solve(rows: list[list[Number]], free: Angles) -> Iterator[Angles]:
        (r11, r12, r13, x), (r21, r22, r23, y), (r31, r32, r33, z), _ = rows
        z = z - d1
        side = (c1 * z - height) / s1
        up = c1 * side + s1 * z
        free4 = free[3]
        for c, s, length in turns(x, y, side, free[0]):
            one = atan2(s, c)
            towards, opening, bend, _ = bent(length - a1, up)
            m11, m12, m13 = c * r11 + s * r21, c * r12 + s * r22, c * r13 + s * r23
            m31, m32, m33 = c * r21 - s * r11, c * r22 - s * r12, c * r23 - s * r13
            m21, m22, m23 = c1 * m31 + s1 * r31, c1 * m32 + s1 * r32, c1 * m33 + s1 * r33
            m31, m32, m33 = c1 * r31 - s1 * m31, c1 * r32 - s1 * m32, c1 * r33 - s1 * m33
            e1, e2, e3 = st * m31, st * m32, st * m33
            for two, bend_ in ((towards - opening, bend), (towards + opening, -bend)):
                beta = two + bend_ - offset
                cb, sb = cos(beta), sin(beta)
                n21, n22, n23 = cb * m21 - sb * m11, cb * m22 - sb * m12, cb * m23 - sb * m13
                first, second, _ = split(
                    (cb * m11 + sb * m21, cb * m12 + sb * m22, cb * m13 + sb * m23),
                    (ct * n21 + e1, ct * n22 + e2, ct * n23 + e3),
                    (ct * m31 - st * n21, ct * m32 - st * n22, ct * m33 - st * n23),
                    free4,
                )
                three = flip * bend_ - bearing
                yield one, two, three, first[0], first[1], first[2]
                yield one, two, three, second[0], second[1], second[2]

    return solve


def crossing_shoulder(
    links: DHLinks, f: Operations, between: tuple[Number, ...] | None = None
) -> Solve:
    """Return solve(rows, free) for axes 1 and 2 that meet; as `parallel_shoulder`.

    ``between``: the rows of the pose (3, 4) of axis 3's frame in that of axis 2 after its turn, 12
    numbers; None for L_2. An arm of seven axes puts its locked joint there.
    """
    s1, c1 = sine_and_cosine(links.t[0])
    s3, c3 = sine_and_cosine(links.t[2])
    cx, cy, cz = wrist_centre(links)
    d1 = links.d[0]
    placed, turned = _maps(links, between, cz)
    if between is None:
        between = tuple(links.link(1)[:3].ravel().tolist())
    g11, g12, g13, gx, g21, g22, g23, gy, g31, g32, g33, gz = between
    # The squared distance of the centre is fixed + along cos(alpha3) + across sin(alpha3).
    hx, hy = g11 * gx + g21 * gy + g31 * gz, g12 * gx + g22 * gy + g32 * gz
    hz = g13 * gx + g23 * gy + g33 * gz
    fixed = cx * cx + cy * cy + cz * cz + gx * gx + gy * gy + gz * gz + 2.0 * hz * cz
    along, across = 2.0 * (hx * cx + hy * cy), 2.0 * (hy * cx - hx * cy)
    atan2, hypot, root, cos, sin, where_free = f.atan2, f.hypot, f.root, f.cos, f.sin, f.where_free
    amplitude, middle = hypot(along, across), atan2(across, along)
    split = three_turns(f, links.t[3], links.t[4])

    def solve(rows: list[list[Number]], free: Angles) -> Iterator[Angles]:
        (r11, r12, r13, x), (r21, r22, r23, y), (r31, r32, r33, z), _ = rows
        z = z - d1
        radius, excess = hypot(x, y), x * x + y * y + z * z - fixed
        opening = 2.0 * atan2(root(amplitude - excess), root(amplitude + excess))
        heading, on_axis = atan2(y, x), radius <= FREE
        free1, free2, free4 = free[0], free[1], free[3]
        columns = [(r11, r21, r31), (r12, r22, r32), (r13, r23, r33)]
        # Arrays take all columns at once.
        columns = columns if f.is_scalar else [(rows[0][:3], rows[1][:3], rows[2][:3])]
        for three in (middle + opening, middle - opening):
            ct, st = cos(three), sin(three)
            px, py = cx * ct - cy * st, cx * st + cy * ct
            vx, vy, vz = placed(px, py)
            rho = hypot(vx, vy)
            level = (z - c1 * vz) / s1
            offset = c1 * level - s1 * vz
            # Both are the same number; the smaller radius keeps more of its digits.
            length = f.select(
                rho < radius,
                root((rho - level) * (rho + level)),
                root((radius - offset) * (radius + offset)),
            )
            bearing, is_above = atan2(vy, vx), rho <= FREE
            for side in (length, -length):
                two = where_free(is_above, free2, atan2(level, side) - bearing)
                one = where_free(on_axis, free1, heading - atan2(offset, side))
                c, s = cos(one), sin(one)
                cb, sb = cos(two), sin(two)
                q = []
                for r1, r2, r3 in columns:
                    m1, m2 = c * r1 + s * r2, c * r2 - s * r1
                    m2, m3 = c1 * m2 + s1 * r3, c1 * r3 - s1 * m2
                    m1, m2 = cb * m1 + sb * m2, cb * m2 - sb * m1
                    n1, n2, n3 = turned(m1, m2, m3)
                    n1, n2 = ct * n1 + st * n2, ct * n2 - st * n1
                    q.append((n1, c3 * n2 + s3 * n3, c3 * n3 - s3 * n2))
                (q11, q21, q31), (q12, q22, q32), (q13, q23, q33) = (
                    q if f.is_scalar else zip(*q[0], strict=True)
                )
                wrist = split((q11, q12, q13), (q21, q22, q23), (q31, q32, q33), free4)
                for a, b, c6, _, _ in wrist[:2]:
                    yield one, two, three, a, b, c6

    return solve


Map = Callable[..., tuple[Number, Number, Number]]


def _maps(links: DHLinks, between: tuple[Number, ...] | None, cz: float) -> tuple[Map, Map]:
    """Return two functions of the pose ``between`` of `crossing_shoulder`.

    The first one places a point (x, y, cz), the second one turns a direction back.
    """
    if between is None:
        s, c = sine_and_cosine(links.t[1])
        gx, gy, gz = links.a[1], -s * cz, links.d[1] + c * cz
        return (
            lambda x, y: (x + gx, c * y + gy, s * y + gz),
            lambda x, y, z: (x, c * y + s * z, c * z - s * y),
        )
    g11, g12, g13, gx, g21, g22, g23, gy, g31, g32, g33, gz = between
    gx, gy, gz = g13 * cz + gx, g23 * cz + gy, g33 * cz + gz
    return (
        lambda x, y: (g11 * x + g12 * y + gx, g21 * x + g22 * y + gy, g31 * x + g32 * y + gz),
        lambda x, y, z: (
            g11 * x + g21 * y + g31 * z,
            g12 * x + g22 * y + g32 * z,
            g13 * x + g23 * y + g33 * z,
        ),
    )


def why_not_spherical(links: DHLinks) -> str:
    """Return the conditions of both closed forms that six axes miss; empty if one holds."""
    if not links.meet(4):
        return f"axes 4, 5 and 6 do not meet in one point ({_apart(links, 4)})"
    if is_parallel_shoulder(links) or is_crossing_shoulder(links):
        return ""
    return "neither are axes 2 and 3 parallel, nor do axes 1 and 2 meet"


def is_parallel_shoulder(links: DHLinks) -> bool:
    """Return whether `parallel_shoulder` solves these six axes."""
    cx, cy, _ = wrist_centre(links)
    return (
        links.meet(4)
        and not links.is_parallel(1)
        and links.is_parallel(2)
        and links.a[1] > 0.0
        and math.hypot(cx, cy) > 0.0
    )


def is_crossing_shoulder(links: DHLinks) -> bool:
    """Return whether `crossing_shoulder` solves these six axes."""
    if not (links.meet(4) and links.crosses(1)):
        return False
    cx, cy, _ = wrist_centre(links)
    G = links.link(1)
    h = G[:3, :3].T @ G[:3, 3]
    return bool(math.hypot(cx, cy) * math.hypot(h[0], h[1]) > 0.0)


def _apart(links: DHLinks, i: int) -> str:
    """Return in words what keeps axes i, i + 1 and i + 2 (from 1) from meeting."""
    for k in (i, i + 1):
        if links.is_parallel(k):
            return f"axes {k} and {k + 1} are parallel"
    gaps = [(links.a[i - 1], f"{i} and {i + 1}"), (links.a[i], f"{i + 1} and {i + 2}")]
    for gap, which in gaps:
        if gap > 0.0:
            return f"axes {which} pass each other {1e3 * gap:.3g} mm apart"
    return f"they meet in two points {1e3 * abs(links.d[i]):.3g} mm apart"


def arm_angle_link(links: DHLinks, theta: FloatArray) -> tuple[Number, ...]:
    """Return L_2 Rz(theta) L_3 for angles ``theta`` (N,) [rad] of the third joint, 12 rows."""
    before, after = links.link(1), links.link(2)
    c, s, zero = np.cos(theta), np.sin(theta), np.zeros_like(theta)
    one = zero + 1.0
    turn = np.array([[c, -s, zero, zero], [s, c, zero, zero], [zero, zero, one, zero]])
    turn = np.concatenate((turn, np.array([[zero, zero, zero, one]])))
    G = np.einsum("ij,jkn,kl->iln", before, turn, after)
    return tuple(G[:3].reshape(12, -1))
