"""The dimensions of a chain by Denavit and Hartenberg, which every closed form here reads.

    T_S_tool(q) = T_S_1 Rz(alpha1) L1 Rz(alpha2) L2 ... Rz(alphan) T_n_tool
    L_i = Tz(d_i) Tx(a_i) Rx(t_i) Ry(b_i),   alpha_i = q_i + shift_i

z_i lies along axis i with its sign. x_i lies along the common normal of axes i and i + 1, at which
a_i >= 0 is their distance and t_i the angle from one to the other. d_i is the distance along axis i
between its two normals. Parallel axes have many normals: the one with d_i = 0 is taken. d_1 and
shift_1 are 0.

The common normal of almost parallel axes may be kilometres away. If the axes are not to be exact,
x_i then leads from axis i, across it, to axis i + 1, and b_i is the tilt that remains. Else b_i is
0.

Sources: Denavit & Hartenberg (1955); Craig, Introduction to Robotics, ch. 3, for the order of
terms; Hayati & Mirmirani (1985) for the tilt.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.turns import wrapped

Numbers = tuple[float, ...]

ALMOST_PARALLEL: Final = 0.1
"""[1] Sine of the angle between two axes below which their common normal is not used."""

DOUBLE: Final = 1e-13
"""[rad], [m] Rounding that is only that of double precision."""

FINE: Final = 1e-7
"""[rad], [m] Rounding of a file up to which its arm is solved as it is written. A file with fewer
decimals does not describe an arm to the accuracy that it is asked for."""


@dataclass(frozen=True, eq=False)
class DHLinks:
    """The dimensions of a chain of n turning joints; the module's text defines them.

    Attributes:
        a, d: (n - 1,) lengths [m].
        t, b: (n - 1,) twists and tilts [rad].
        shift: (n,) angles [rad].
        T_S_1, T_n_tool: poses (4, 4) of the first frame in {S} and of the tool in the last.
        rounding: the largest deviation [rad], [m] of a twist or length that was replaced by a
            quarter turn or 0.
        slides: (n,) whether each joint slides: it has a fixed angle, and a length along its axis.
            Empty if none does.
    """

    a: Numbers
    d: Numbers
    t: Numbers
    b: Numbers
    shift: Numbers
    T_S_1: FloatArray
    T_n_tool: FloatArray
    rounding: tuple[float, float] = (0.0, 0.0)
    slides: tuple[bool, ...] = ()

    @property
    def n(self) -> int:
        """The number of joints."""
        return len(self.shift)

    @cached_property
    def T_1_S(self) -> FloatArray:
        """The inverse (4, 4) of T_S_1."""
        return frozen(se3.inverse(self.T_S_1))

    @cached_property
    def T_tool_n(self) -> FloatArray:
        """The inverse (4, 4) of T_n_tool."""
        return frozen(se3.inverse(self.T_n_tool))

    @cached_property
    def reach(self) -> float:
        """An upper bound [m] on the distance of the tool point from axis 1's frame."""
        tool = float(np.linalg.norm(self.T_n_tool[:3, 3]))
        return math.fsum(self.a) + math.fsum(map(abs, self.d)) + tool

    def is_parallel(self, i: int) -> bool:
        """Return whether axes i and i + 1 (from 1) are parallel or opposite."""
        return math.sin(self.t[i - 1]) == 0.0 or abs(self.t[i - 1]) == math.pi

    def crosses(self, i: int) -> bool:
        """Return whether axes i and i + 1 (from 1) meet in one point."""
        return not self.is_parallel(i) and self.a[i - 1] == 0.0

    def meet(self, i: int) -> bool:
        """Return whether axes i, i + 1 and i + 2 (from 1) meet in one point."""
        return self.crosses(i) and self.crosses(i + 1) and self.d[i] == 0.0

    def from_axis(self, first: int) -> DHLinks:
        """Return the links of the chain that begins with axis ``first``, counted from 0."""
        a, d, t, b = (numbers[first:] for numbers in (self.a, self.d, self.t, self.b))
        return dataclasses.replace(self, a=a, d=d, t=t, b=b, shift=self.shift[first:])

    def link(self, i: int) -> FloatArray:
        """Return L_i (4, 4), i from 0."""
        L = _link(self.a[i], self.d[i], self.t[i])
        if self.b[i]:
            L[:3, :3] = L[:3, :3] @ so3.rotation_y(self.b[i])
        return L


def sine_and_cosine(t: float) -> tuple[float, float]:
    """Return the sine and cosine of a twist, exact at quarter turns."""
    quarters = t / (0.5 * math.pi)
    if quarters == round(quarters):
        k = round(quarters) % 4
        return (0.0, 1.0, 0.0, -1.0)[k], (1.0, 0.0, -1.0, 0.0)[k]
    return math.sin(t), math.cos(t)


def _link(a: float, d: float, t: float) -> FloatArray:
    s, c = sine_and_cosine(t)
    return np.array([[1.0, 0.0, 0.0, a], [0.0, c, -s, 0.0], [0.0, s, c, d], [0.0, 0.0, 0.0, 1.0]])


def links_of(chain: Chain, *, exact: bool = True, gap: float = tolerances.FAMILY_LENGTH) -> DHLinks:
    """Return the dimensions of `chain`.

    With ``exact``, rounding in its file is removed: twists within FAMILY_ANGLE of a quarter turn
    and lengths within ``gap`` [m] of 0 are exactly that. The tool's home pose stays. A right
    angle that is rounded by at most FINE stays too, because every closed form takes any twist of
    axes that are not parallel.
    """
    angle, almost = tolerances.FAMILY_ANGLE, 0.0
    if not exact:
        angle, gap, almost = DOUBLE, tolerances.ROUNDING, ALMOST_PARALLEL
    n = chain.n
    z = list(chain.axes.T)
    points = [screws.point_on(chain.S[:, i]) for i in range(n)]
    a, d, t, b, shift = [], [], [], [], [0.0]
    first = T = _start(z[0], points[0])
    off_angle = off_length = 0.0
    for i in range(n - 1):
        place, x_before = T[:3, 3], T[:3, 0]
        along, length, twist, tilt, x = _normal(
            z[i], place, z[i + 1], points[i + 1], x_before, (angle, gap), almost
        )
        exact_twist = twist if tilt else _snapped(twist, angle)
        exact_length = _zeroed(length, gap)
        exact_along = _zeroed(along, gap)
        if i == 0:
            first = T = _frame(z[0], x, place + along * z[0])
            exact_along = 0.0
        else:
            turn = math.atan2(float(np.cross(x_before, x) @ z[i]), float(x_before @ x))
            shift.append(turn)
            off_length = max(off_length, abs(exact_along - along))
        off_angle = max(off_angle, abs(wrapped(exact_twist - twist)))
        off_length = max(off_length, abs(exact_length - length))
        a.append(exact_length)
        d.append(exact_along)
        t.append(exact_twist)
        b.append(tilt)
        origin = T[:3, 3] + (0.0 if i == 0 else along) * z[i] + length * x
        T = _frame(z[i + 1], (x - math.sin(tilt) * z[i + 1]) / math.cos(tilt), origin)
    shift.append(0.0)
    shift = shift[:n]
    links = DHLinks(
        a=tuple(a),
        d=tuple(d),
        t=tuple(t),
        b=tuple(b),
        shift=tuple(shift),
        T_S_1=frozen(first),
        T_n_tool=frozen(np.eye(4)),
        slides=chain.slides if any(chain.slides) else (),
        rounding=(off_angle, off_length),
    )
    T_tool = se3.inverse(_home(links)) @ chain.M
    return dataclasses.replace(links, T_n_tool=frozen(T_tool))


def _home(links: DHLinks) -> FloatArray:
    """Return the pose (4, 4) of the last frame in {S} at q = 0."""
    T = np.array(links.T_S_1)
    for i in range(links.n):
        T = T @ _turned(links.shift[i])
        if i < links.n - 1:
            T = T @ links.link(i)
    return T


def exact_chain(chain: Chain, links: DHLinks) -> Chain:
    """Return `chain` with the screw axes of `links`, which have no rounding."""
    T = np.array(links.T_S_1)
    S = []
    for i in range(links.n):
        S.append(screws.revolute(T[:3, 2], T[:3, 3]))
        T = T @ _turned(links.shift[i])
        if i < links.n - 1:
            T = T @ links.link(i)
    return dataclasses.replace(chain, S=np.column_stack(S))


def reversed_chain(chain: Chain) -> Chain:
    """Return the chain seen from the tool: its joints in the opposite order, its base at the tool.

    The pose of its tool is the inverse of the pose of `chain`, at the reversed joint angles.
    """
    T_tool_S = se3.inverse(chain.M)
    return Chain(
        M=T_tool_S,
        S=-screws.moved(T_tool_S, chain.S)[:, ::-1],
        lower=chain.lower[::-1],
        upper=chain.upper[::-1],
        speed=chain.speed[::-1],
        names=chain.names[::-1],
    )


def _turned(theta: float) -> FloatArray:
    return se3.from_rotation_translation(so3.rotation_z(theta), np.zeros(3))


def _start(z: FloatArray, point: FloatArray) -> FloatArray:
    """Return a frame (4, 4) with `z` at `point`, its x in any direction."""
    other = np.eye(3)[int(np.abs(z).argmin())]
    x = other - (other @ z) * z
    return _frame(z, x / np.linalg.norm(x), point)


def _frame(z: FloatArray, x: FloatArray, origin: FloatArray) -> FloatArray:
    return se3.from_rotation_translation(np.column_stack((x, np.cross(z, x), z)), origin)


def _normal(
    z: FloatArray,
    place: FloatArray,
    z2: FloatArray,
    p2: FloatArray,
    x: FloatArray,
    within: tuple[float, float],
    almost: float,
) -> tuple[float, float, float, float, FloatArray]:
    """Return the common normal of an axis through `place` and the next one.

    The values are its distance along the axis from `place` [m], its length [m], the twist and the
    tilt [rad], and its direction (3,). `x` is used where the axes are one line. ``within`` is the
    angle [rad] and the length [m] that count as 0. Up to the sine ``almost`` of their angle, the
    line across the first axis from `place` is in place of the normal.
    """
    across = np.cross(z, z2)
    sine, cosine = float(np.linalg.norm(across)), float(z @ z2)
    gap = p2 - place
    if sine <= within[0]:
        between = gap - (gap @ z) * z
        length = float(np.linalg.norm(between))
        direction = between / length if length > within[1] else x
        return 0.0, length, math.atan2(sine, cosine), 0.0, direction
    if sine <= almost:
        between = gap - z2 * float(gap @ z) / cosine
        length = float(np.linalg.norm(between))
        direction = between / length if length > within[1] else x
        twist = math.atan2(-float(np.cross(z, direction) @ z2), cosine)
        return 0.0, length, twist, math.asin(float(direction @ z2)), direction
    direction = across / sine
    along = float(np.cross(gap, z2) @ across) / sine**2
    length = float(gap @ direction)
    if length < -within[1]:
        return along, -length, -math.atan2(sine, cosine), 0.0, -direction
    return along, length, math.atan2(sine, cosine), 0.0, direction


def _snapped(twist: float, within: float) -> float:
    """Return the quarter turn ``within`` [rad] of the twist; see `links_of` for right angles."""
    quarters = round(twist / (0.5 * math.pi))
    off = abs(twist - 0.5 * math.pi * quarters)
    is_kept = off > within or (quarters % 2 == 1 and DOUBLE < off <= FINE)
    return twist if is_kept else 0.5 * math.pi * quarters


def _zeroed(length: float, within: float) -> float:
    return 0.0 if abs(length) <= within else length
