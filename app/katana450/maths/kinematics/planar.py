"""Axes 2, 3 and 4 as a planar 3R arm with limits: its tool points and their pitches.

The plane is that of the canonical arm. Its origin is the shoulder; u points outward from axis 1 and
v downward along it, so that theta2, theta3, theta4 (here the canonical angles) turn u towards v.
phi = theta2 + theta3 + theta4 is the angle of the last link below the horizontal. Lengths in m,
angles in rad. `LimitedArm` has the planar arms of the canonical arm on each branch.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from katana450 import tolerances
from katana450.maths.kinematics.arm import Five, FiveAxisArm, arm_of
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.turns import wrapped


class Interval(NamedTuple):
    """The range of angles of a joint; infinite ends mean any angle."""

    lower: float
    upper: float

    def fit(self, theta: float) -> float | None:
        """Return `theta` in the turn inside the interval, or None if there is none.

        An angle that is outside by rounding is set to the end.
        """
        lower, upper = self
        if lower <= theta <= upper:
            return theta if lower > -math.inf else wrapped(theta)
        middle = 0.5 * (lower + upper)
        theta = middle + math.remainder(theta - middle, math.tau)
        slack = tolerances.PLANAR_LIMIT_SLACK
        if lower - slack <= theta <= upper + slack:
            return min(max(theta, lower), upper)
        return None

    @property
    def ends(self) -> tuple[float, ...]:
        """The two limits; empty when every angle is allowed."""
        return () if self.lower == -math.inf else (self.lower, self.upper)


ANY_ANGLE = Interval(-math.inf, math.inf)


class Posture(NamedTuple):
    """The angles of the planar arm.

    `stretched` is True if links in one line, not only limits, keep it from coming nearer.
    """

    theta2: float
    theta3: float
    theta4: float
    stretched: bool = False

    @property
    def phi(self) -> float:
        """The pitch: the angle of the last link below the horizontal."""
        return self.theta2 + self.theta3 + self.theta4


class _Shape(NamedTuple):
    """The links beyond a joint as one rigid link: length, and angle to the first of them."""

    length: float
    bearing: float


def _joined(first: float, second: float, bend: float) -> _Shape:
    """Return two links at the angle `bend` as one rigid link."""
    x, y = first + second * math.cos(bend), second * math.sin(bend)
    return _Shape(math.hypot(x, y), math.atan2(y, x))


def _meeting(
    center1: tuple[float, float], radius1: float, center2: tuple[float, float], radius2: float
) -> tuple[tuple[float, float], ...]:
    """Return the two intersections of two circles (they may coincide), or none.

    Concentric circles have none.
    """
    dx, dy = center2[0] - center1[0], center2[1] - center1[1]
    d = math.hypot(dx, dy)
    if d == 0.0:
        return ()
    along = 0.5 * (d + (radius1 - radius2) * (radius1 + radius2) / d)
    radicand = (radius1 - along) * (radius1 + along)
    if radicand < -tolerances.RADICAND * radius1 * radius1:
        return ()
    across = math.sqrt(max(radicand, 0.0))
    ex, ey = dx / d, dy / d
    foot = center1[0] + along * ex, center1[1] + along * ey
    return (
        (foot[0] - across * ey, foot[1] + across * ex),
        (foot[0] + across * ey, foot[1] - across * ex),
    )


def directions(
    center: tuple[float, float], radius: float, target: tuple[float, float], axis: float | None
) -> Iterator[float]:
    """Yield the direction from `center` to the target, and those to the points with u = `axis`."""
    yield math.atan2(target[1] - center[1], target[0] - center[0])
    out = math.inf if axis is None else axis - center[0]
    if abs(out) <= radius:
        across = math.sqrt((radius - out) * (radius + out))
        yield math.atan2(across, out)
        yield math.atan2(-across, out)


@dataclass(frozen=True, slots=True)
class PlanarArm:
    """A planar 3R arm on one branch.

    Attributes:
        l1, l2, l3: link lengths [m].
        theta2, theta4: the limits of these joints.
        theta3: its limits, cut to one side of the stretched and of the folded arm. An end there is
            that singularity, not a limit.
        bend: +1 where that side is the elbow up, -1 where it is down.
        axis: u of axis 1 [m].
        side: +1 where the tool point must keep u >= axis, -1 where u <= axis.
    """

    l1: float
    l2: float
    l3: float
    theta2: Interval
    theta3: Interval
    theta4: Interval
    bend: int
    axis: float
    side: int

    def behind(self, u: float) -> float:
        """Return the distance [m] of a point beyond axis 1; negative on the arm's side."""
        return (self.axis - u) * self.side

    def tool(self, posture: Posture) -> tuple[float, float]:
        """Return (u, v) [m] of the tool point."""
        a = posture.theta2
        b = a + posture.theta3
        c = b + posture.theta4
        return (
            self.l1 * math.cos(a) + self.l2 * math.cos(b) + self.l3 * math.cos(c),
            self.l1 * math.sin(a) + self.l2 * math.sin(b) + self.l3 * math.sin(c),
        )

    def at(self, u: float, v: float, phi: float) -> Posture | None:
        """Return the posture with the tool point at (u, v) and pitch `phi`, or None.

        The pitch gives the wrist. theta3 brings the wrist to its distance from the shoulder
        (subproblem 3; the branch chooses one of its two solutions), and theta2 brings it into place
        (subproblem 1). None means that the limits or the links do not allow it.
        """
        wu, wv = u - self.l3 * math.cos(phi), v - self.l3 * math.sin(phi)
        rho = math.hypot(wu, wv)
        far, near = self.l1 + self.l2, abs(self.l1 - self.l2)
        stretched, folded = (far - rho) * (far + rho), (rho - near) * (rho + near)
        if min(stretched, folded) < -tolerances.RADICAND * far * far:
            return None
        bend = 2.0 * math.atan2(math.sqrt(max(stretched, 0.0)), math.sqrt(max(folded, 0.0)))
        theta3 = self.bend * bend
        theta2 = math.atan2(wv, wu) - _joined(self.l1, self.l2, theta3).bearing
        return self._posture(theta2, theta3, phi - theta2 - theta3)

    def pitch_ends(self, u: float, v: float) -> Iterator[Posture]:
        """Yield the postures at (u, v) with a joint at an end: between them the pitch can vary.

        Each end fixes one joint, which leaves two circles that meet in the elbow or the wrist.
        """
        origin, tool = (0.0, 0.0), (u, v)
        for theta3 in self.theta3.ends:
            shape = _joined(self.l1, self.l2, theta3)
            for wu, wv in _meeting(origin, shape.length, tool, self.l3):
                theta2 = math.atan2(wv, wu) - shape.bearing
                theta4 = math.atan2(v - wv, u - wu) - theta2 - theta3
                yield from self._if_fits(theta2, theta3, theta4, self._singular(theta3))
        for theta2 in self.theta2.ends:
            elbow = self.l1 * math.cos(theta2), self.l1 * math.sin(theta2)
            for wu, wv in _meeting(elbow, self.l2, tool, self.l3):
                theta3 = math.atan2(wv - elbow[1], wu - elbow[0]) - theta2
                theta4 = math.atan2(v - wv, u - wu) - theta2 - theta3
                yield from self._if_fits(theta2, theta3, theta4)
        for theta4 in self.theta4.ends:
            shape = _joined(self.l2, self.l3, theta4)
            for eu, ev in _meeting(origin, self.l1, tool, shape.length):
                theta2 = math.atan2(ev, eu)
                theta3 = math.atan2(v - ev, u - eu) - shape.bearing - theta2
                yield from self._if_fits(theta2, theta3, theta4)

    def nearest(self, u: float, v: float) -> Posture:
        """Return the posture with the tool point nearest to (u, v), which is out of reach.

        The nearest point of the joint box meets the Karush-Kuhn-Tucker conditions: each joint is at
        an end, or on one line with tool point and target. All such postures are listed, and the
        nearest one inside the limits is taken. If that lies across axis 1, the tool point may also
        be on the axis. If the limits keep the tool point off the arm's side altogether, that
        condition is dropped.
        """

        def misplaced(posture: Posture) -> tuple[bool, float]:
            pu, pv = self.tool(posture)
            wrong_side = self.behind(pu) > tolerances.PLANAR_LIMIT_SLACK
            return wrong_side, math.hypot(pu - u, pv - v)

        best = min(self._stationary(u, v, on_axis=False), key=lambda p: misplaced(p)[1])
        if not misplaced(best)[0]:
            return best
        return min(self._stationary(u, v, on_axis=True), key=misplaced)

    def _stationary(self, u: float, v: float, *, on_axis: bool) -> Iterator[Posture]:
        """Yield the postures that meet the Karush-Kuhn-Tucker conditions for (u, v)."""
        target, axis = (u, v), self.axis if on_axis else None
        for theta3, theta4, stretched in self._shapes_beyond_shoulder():
            if self.theta3.fit(theta3) is None or self.theta4.fit(theta4) is None:
                continue
            forearm = _joined(self.l2, self.l3, theta4)
            arm = _joined(self.l1, forearm.length, theta3 + forearm.bearing)
            for direction in directions((0.0, 0.0), arm.length, target, axis):
                yield from self._if_fits(direction - arm.bearing, theta3, theta4, stretched)
        for theta2 in self.theta2.ends:
            elbow = self.l1 * math.cos(theta2), self.l1 * math.sin(theta2)
            for theta4, stretched in self._shapes_beyond_elbow():
                if self.theta4.fit(theta4) is None:
                    continue
                shape = _joined(self.l2, self.l3, theta4)
                for direction in directions(elbow, shape.length, target, axis):
                    theta3 = direction - shape.bearing - theta2
                    yield from self._if_fits(theta2, theta3, theta4, stretched)
            for theta3 in self.theta3.ends:
                b = theta2 + theta3
                wrist = elbow[0] + self.l2 * math.cos(b), elbow[1] + self.l2 * math.sin(b)
                singular = self._singular(theta3)
                for direction in directions(wrist, self.l3, target, axis):
                    yield from self._if_fits(theta2, theta3, direction - b, singular)
                for theta4 in self.theta4.ends:
                    yield from self._if_fits(theta2, theta3, theta4, singular)

    def _shapes_beyond_shoulder(self) -> Iterator[tuple[float, float, bool]]:
        """Yield (theta3, theta4, stretched) at which a turn about the shoulder may be nearest."""
        for theta3 in self.theta3.ends:
            for theta4 in self.theta4.ends:
                yield theta3, theta4, self._singular(theta3)
            bearing = _joined(self.l1, self.l2, theta3).bearing - theta3
            yield theta3, bearing, True
            yield theta3, bearing + math.pi, True
        for theta4 in self.theta4.ends:
            bearing = _joined(self.l2, self.l3, theta4).bearing
            yield -bearing, theta4, True
            yield math.pi - bearing, theta4, True

    def _shapes_beyond_elbow(self) -> Iterator[tuple[float, bool]]:
        """Yield (theta4, stretched) at which a turn about the elbow may be nearest."""
        for theta4 in self.theta4.ends:
            yield theta4, False
        yield 0.0, True
        yield math.pi, True

    def _singular(self, theta3: float) -> bool:
        return abs(math.remainder(theta3, math.pi)) <= tolerances.ROUNDING

    def _if_fits(
        self, theta2: float, theta3: float, theta4: float, stretched: bool = False
    ) -> Iterator[Posture]:
        posture = self._posture(theta2, theta3, theta4, stretched)
        if posture is not None:
            yield posture

    def _posture(
        self, theta2: float, theta3: float, theta4: float, stretched: bool = False
    ) -> Posture | None:
        b = self.theta3.fit(theta3)
        c = None if b is None else self.theta4.fit(theta4)
        a = None if c is None else self.theta2.fit(theta2)
        return None if a is None or b is None or c is None else Posture(a, b, c, stretched)


Intervals = tuple[Interval, Interval, Interval, Interval, Interval]


@dataclass(frozen=True, eq=False)
class LimitedArm:
    """The canonical arm `arm` with the range of angles [rad] of each axis."""

    arm: FiveAxisArm
    limits: Intervals
    _planar: dict[Branch, tuple[PlanarArm, ...]] = field(default_factory=dict, repr=False)

    @staticmethod
    def of(chain: Chain, *, within_limits: bool = True) -> LimitedArm:
        """Return the arm of `chain`; the result is cached.

        With `within_limits` False the arm has no limits. Raises RobotDescriptionError as `arm_of`.
        """
        return _limited(chain, within_limits)

    def near(self, alpha: Five, reach: float, theta1: Interval) -> LimitedArm:
        """Return the arm with axes 2 to 5 within `reach` [rad] of `alpha`, axis 1 in `theta1`."""
        _, two, three, four, five = (
            Interval(max(lower, angle - reach), min(upper, angle + reach))
            for (lower, upper), angle in zip(self.limits, alpha, strict=True)
        )
        return LimitedArm(self.arm, (theta1, two, three, four, five))

    def turned(self, alpha: Five, hint: Five) -> Five:
        """Return `alpha` in those turns inside the limits that are nearest to `hint`."""
        one, two, three, four, five = (
            _in_turn(limits, angle, near)
            for limits, angle, near in zip(self.limits, alpha, hint, strict=True)
        )
        return one, two, three, four, five

    def planar(self, branch: Branch | None) -> list[tuple[Branch, PlanarArm]]:
        """Return axes 2 to 4 on `branch`, or on every branch that the limits allow.

        There is one arm for each piece of theta3. If the limits exclude the elbow of `branch`, the
        piece is the limit nearest to it.
        """
        if branch is not None:
            return [(branch, arm) for arm in self._pieces(branch)]
        _, _, theta3, _, _ = self.limits
        return [
            (candidate, arm)
            for candidate in BRANCHES
            if _bends(theta3, _bend(candidate))
            for arm in self._pieces(candidate)
        ]

    def _pieces(self, branch: Branch) -> tuple[PlanarArm, ...]:
        pieces = self._planar.get(branch)
        if pieces is None:
            arm, (_, theta2, theta3, theta4, _) = self.arm, self.limits
            bend, side = _bend(branch), 1 if branch.shoulder == "front" else -1
            pieces = tuple(
                PlanarArm(arm.l1, arm.l2, arm.l3, theta2, piece, theta4, sign, -arm.a, side)
                for sign, piece in _bends(theta3, bend) or _least_bend(theta3, -bend)
            )
            self._planar[branch] = pieces
        return pieces


@lru_cache(maxsize=64)
def _limited(chain: Chain, within_limits: bool) -> LimitedArm:
    arm = arm_of(chain)
    if not within_limits:
        return LimitedArm(arm, (ANY_ANGLE,) * 5)
    ends = np.sort((arm.canonical(chain.lower), arm.canonical(chain.upper)), axis=0)
    one, two, three, four, five = (Interval(*pair) for pair in ends.T.tolist())
    return LimitedArm(arm, (one, two, three, four, five))


def _bend(branch: Branch) -> int:
    return 1 if branch.elbow == "up" else -1


def _in_turn(limits: Interval, angle: float, hint: float) -> float:
    if abs(hint - angle) <= math.pi:
        return angle
    turned = angle + math.tau * round((hint - angle) / math.tau)
    return turned if limits.lower <= turned <= limits.upper else angle


def _bends(theta3: Interval, bend: int) -> list[tuple[int, Interval]]:
    """Return the parts of `theta3` on one side of the stretched and of the folded arm."""
    if theta3 == ANY_ANGLE:
        theta3 = Interval(-math.pi, math.pi)
    half_turns = range(math.floor(theta3.lower / math.pi), math.ceil(theta3.upper / math.pi))
    return [
        (bend, Interval(max(theta3.lower, k * math.pi), min(theta3.upper, (k + 1) * math.pi)))
        for k in half_turns
        if (k % 2 == 0) == (bend > 0)
    ]


def _least_bend(theta3: Interval, bend: int) -> list[tuple[int, Interval]]:
    """Return the end of `theta3` nearest to an elbow that the limits exclude."""
    end = min(theta3, key=lambda theta: abs(math.sin(theta)))
    return [(bend, Interval(end, end))]
