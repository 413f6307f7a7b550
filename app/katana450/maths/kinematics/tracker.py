"""Following a target that a hand drags: the goal goes on from where it is, or holds.

The nearest feasible pose can leap while the target creeps: the limits split the pitches that reach
a point in two ranges, axis 1 has a gap, and over axis 1 the arm would have to turn round. So the
nearest pose is only taken where it is one hop from the goal. Elsewhere it is sought within a hop,
again and again, each time from the pose found last: that never leads away from the target, slides
along what is in the way, and stops where only a leap would bring the tool nearer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import Five, FiveAxisArm
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.canonical_target import CanonicalTarget
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.limited import LimitedArm
from katana450.maths.kinematics.nearest_posture import NearestPosture, nearest_posture
from katana450.maths.kinematics.planar import Interval
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import (
    ANGLE_WORTH_TELLING,
    POSITION_WORTH_TELLING,
    Projection,
    measured,
)
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.turns import wrapped

HOP: Final = 0.1
"""[rad] How far an axis may go at once: what the joints do in a twelfth of a second, so that a
person sees motion and no leap."""

DRAG_STRIDE: Final = 0.02
"""[m] A faster drag is followed along its way in strides: about a hop of the joints."""

MAX_PATH_LENGTH: Final = 32
"""Strides along one drag; a longer one takes longer strides."""

MAX_DISTANCE_RATIO: Final = 16.0
"""[1] Of the arm's reach: of a hand that is farther away its direction alone counts on the way, so
that every way has an end."""

MAX_POSES: Final = 18
"""Nearest poses sought in one call. What is farther is reached in the next: the joints need several
ticks for a hop, so the goal stays ahead of them."""

MAX_POSES_OUT_OF_REACH: Final = 3
"""Looking for the nearest to what cannot be reached takes that many times as long."""

MAX_POSES_PER_STRIDE: Final = 2 * MAX_POSES_OUT_OF_REACH
"""For the hops of one stride: two are enough unless something is in the way."""

MIN_HOP_GAIN: Final = 1e-6
"""[m], [rad] Coming nearer by less is rounding."""

MIN_LEAP_GAIN: Final = 5e-5
"""[m], [rad] A leap that brings the tool nearer by less than half of the arm's precision is not
missed."""


class TrackingStatus(Enum):
    """How the goal stands to the target."""

    OK = "ok"
    LIMITED = "limited"
    GAP = "gap"


@dataclass(frozen=True, eq=False)
class Tracked:
    """Where the goal goes, and what it would take a leap to get.

    best: the pose to go to. since: how far along its way the target has been followed, when `best`
    is not yet as near as hops lead; the next call goes on from there. ahead: the better pose beyond
    a gap, or None when `best` is as near as the arm comes on its branch, or under way.
    """

    best: Projection
    beyond_gap: Projection | None = None
    since: ToolTarget | None = None

    @property
    def status(self) -> TrackingStatus:
        """HELD when a better pose lies beyond a gap, OK when nothing worth telling is given up."""
        if self.beyond_gap is not None:
            return TrackingStatus.GAP
        given_up = (
            self.best.position_error > POSITION_WORTH_TELLING
            or self.best.rotation_error > ANGLE_WORTH_TELLING
        )
        return TrackingStatus.LIMITED if given_up else TrackingStatus.OK

    def leap_ahead(self) -> tuple[int, float]:
        """The axis (from 0) that would leap farthest to the pose ahead, and how far [rad]."""
        if self.beyond_gap is None:
            return 0, 0.0
        way = np.abs(self.beyond_gap.q - self.best.q)
        return int(way.argmax()), float(way.max())


def track(
    chain: Chain,
    q: npt.ArrayLike,
    target: ToolTarget,
    *,
    branch: Branch,
    priority: Priority = Priority.POSE,
    since: ToolTarget | None = None,
) -> Tracked:
    """From the goal `q` (5,) [rad] on `branch`, inside the limits, on towards `target`.

    since: where the target was when the goal became `q`; a drag from there that is longer than a
    stride is followed along its straight way. The goal never changes branch, and a stride of the
    target moves the goal by more than a hop an axis only along a way on which each hop brings it
    nearer. One call takes bounded time: see `Tracked.since`.
    """
    limited = LimitedArm.of(chain)
    alpha = limited.arm.angles(chain.clamp(q))
    canonical = target.canonical(limited.arm, priority)
    ahead = nearest_posture(limited, canonical, branch, alpha)
    if _within_hop(alpha, ahead.alpha):
        return Tracked(
            _projection(chain, target, canonical, _not_away(limited.arm, alpha, canonical, ahead))
        )
    # One hop at least, so that there is an end.
    effort = max(MAX_POSES - _effort(ahead), 1)
    for stop in () if since is None else _way(limited.arm, since, target):
        stop_target = stop.canonical(limited.arm, priority)
        pursuit = _Pursuit(
            limited, stop_target, nearest_posture(limited, stop_target, branch, alpha)
        )
        found = pursuit.follow(alpha, MAX_POSES_PER_STRIDE)
        alpha, effort = found.alpha, effort - _effort(pursuit.best) - pursuit.effort
        if effort <= 0:
            return Tracked(_projection(chain, target, canonical, found), since=stop)
    pursuit = _Pursuit(limited, canonical, ahead)
    found = pursuit.follow(alpha, effort)
    best = _projection(chain, target, canonical, found)
    if not pursuit.ended:
        return Tracked(best, since=target)
    miss, miss_ahead = (_misses(limited.arm, canonical, s.alpha) for s in (found, ahead))
    if not _nearer(miss_ahead, miss, MIN_LEAP_GAIN):
        return Tracked(best)
    return Tracked(best, beyond_gap=_projection(chain, target, canonical, ahead))


def leap(
    chain: Chain, q: FloatArray, target: ToolTarget, branch: Branch, priority: Priority
) -> Projection:
    """The nearest pose to `target` on `branch`, however far from the goal `q` (5,) [rad].

    Pitch and roll are taken in the plane the arm comes to stand in. Errors as of `project`.
    """
    limited = LimitedArm.of(chain)
    canonical = target.canonical(limited.arm, priority)
    found_posture = nearest_posture(
        limited, canonical, branch, limited.arm.angles(chain.check_q(q))
    )
    return _projection(chain, target, canonical, found_posture)


def _projection(
    chain: Chain, target: ToolTarget, canonical: CanonicalTarget, found_posture: NearestPosture
) -> Projection:
    sign = LimitedArm.of(chain).arm.signs[0]
    return measured(
        chain, target.pose(chain, sign * found_posture.alpha[0]), canonical, found_posture
    )


def _near(arm: FiveAxisArm, target: ToolTarget) -> ToolTarget:
    far = math.hypot(*target.position) / (MAX_DISTANCE_RATIO * arm.reach)
    return target if far <= 1.0 else replace(target, position=target.position / far)


def _way(arm: FiveAxisArm, since: ToolTarget, target: ToolTarget) -> Iterator[ToolTarget]:
    """The stops of the drag, without its ends."""
    since, target = _near(arm, since), _near(arm, target)
    strides = max(
        math.dist(since.position, target.position) / DRAG_STRIDE,
        abs(target.pitch - since.pitch) / HOP,
        abs(target.roll - since.roll) / HOP,
    )
    count = math.ceil(min(strides, MAX_PATH_LENGTH))
    return (since.towards(target, i / count) for i in range(1, count))


class _Pursuit:
    """The way in hops to `asked`, of which `best` is the nearest pose.

    effort: what looking for them took. ended: whether no further one would lead nearer.
    """

    def __init__(
        self, limited: LimitedArm, canonical: CanonicalTarget, best: NearestPosture
    ) -> None:
        self.limited = limited
        self.canonical = canonical
        self.best = best
        self.effort = 0
        self.ended = False

    def follow(self, alpha: Five, maximum: int) -> NearestPosture:
        """`best` if it is a hop away, else where hops from `alpha` of so much effort lead."""
        arm = self.limited.arm
        found, miss = None, _misses(arm, self.canonical, alpha)
        while not self.ended and self.effort < maximum:
            if _within_hop(alpha, self.best.alpha):
                found, self.ended = _not_away(arm, alpha, self.canonical, self.best), True
                break
            hop = _hop(self.limited, alpha, self.canonical, self.best.branch)
            self.effort += _effort(hop)
            hop_miss = _misses(arm, self.canonical, hop.alpha)
            worthwhile = _nearer(hop_miss, miss, MIN_HOP_GAIN)
            # Where not the bounds of the hop hold it, another one would lead nowhere.
            self.ended = not worthwhile or _within(HOP * (1.0 - MIN_HOP_GAIN), alpha, hop.alpha)
            if worthwhile or (found is None and not _nearer(miss, hop_miss, tolerances.ROUNDING)):
                found, alpha, miss = hop, hop.alpha, hop_miss
            else:
                # It stands, for what holds the hop.
                found = hop._replace(alpha=alpha)
        assert found is not None
        return found


def _effort(found_posture: NearestPosture) -> int:
    reached = found_posture.position_error <= tolerances.SAME_POSITION
    return found_posture.searches * (1 if reached else MAX_POSES_OUT_OF_REACH)


def _not_away(
    arm: FiveAxisArm, alpha: Five, canonical: CanonicalTarget, best: NearestPosture
) -> NearestPosture:
    """`best`, but not where it only ends near the nearest place, farther from it than `alpha`."""
    if arm.off_axis == 0.0:
        return best
    miss, miss_best = (_misses(arm, canonical, angles) for angles in (alpha, best.alpha))
    away = _nearer(miss, miss_best, tolerances.SAME_POSITION)
    return best._replace(alpha=alpha) if away else best


def _hop(
    limited: LimitedArm, alpha: Five, canonical: CanonicalTarget, branch: Branch
) -> NearestPosture:
    """The nearest pose with every axis within a hop of `alpha`."""
    arm = limited.arm
    theta1 = _theta1(limited, alpha[0], canonical, branch)
    if canonical.priority is Priority.PITCH:
        # The pitch comes first, and no posture within a hop has one that is farther away.
        pitch = arm.pitch(alpha)
        turn = wrapped(canonical.pitch(alpha[0]) - pitch)
        canonical = canonical.pitched(arm, pitch + min(max(turn, -HOP), HOP))
    return nearest_posture(limited.near(alpha, HOP, theta1), canonical, branch, alpha)


def _theta1(
    limited: LimitedArm, theta1: float, canonical: CanonicalTarget, branch: Branch
) -> Interval:
    """Where axis 1 may go from `theta1` in a hop, which is the way that leads nearer."""
    facing = canonical.facing(limited.arm, branch.shoulder)
    if facing is None:
        return Interval(theta1, theta1)
    turn = wrapped(facing - theta1)
    aside = canonical.aside(limited.arm)
    if aside != 0.0:
        # A plane beside axis 1 comes nearer on one way round, though it may be the longer one.
        square = math.copysign(0.5 * math.pi, aside) - (
            math.atan2(canonical.y, canonical.x) - facing
        )
        turn = square + wrapped(turn - square)
    elif abs(turn) > 0.5 * math.pi:
        # The target is behind the tool point's side of axis 1: no small turn brings it nearer.
        return Interval(theta1, theta1)
    limits = limited.limits[0]
    lower, upper = max(limits.lower, theta1 - HOP), min(limits.upper, theta1 + HOP)
    if abs(turn) <= HOP:
        return Interval(lower, upper)
    end = lower if turn < 0.0 else upper
    return Interval(end, end)


def _within(reach: float, a: Five, b: Five) -> bool:
    return all(abs(x - y) <= reach for x, y in zip(a, b, strict=True))


def _within_hop(a: Five, b: Five) -> bool:
    return _within(HOP, a, b)


def _misses(arm: FiveAxisArm, canonical: CanonicalTarget, alpha: Five) -> tuple[float, ...]:
    """What `alpha` misses of `asked` [m], [rad], what counts most first."""
    position = math.dist(arm.tool_point(alpha), canonical.tool)
    pitch, roll = arm.pitch(alpha), alpha[4]
    if canonical.priority is Priority.POSE:
        return position, canonical.orientation.angle(pitch, roll)
    wished_pitch, wished_roll = canonical.orientation.best()
    pitch, roll = abs(wrapped(pitch - wished_pitch)), abs(wrapped(roll - wished_roll))
    if canonical.priority is Priority.PITCH:
        return pitch, position, roll
    return position, pitch, roll


def _nearer(a: tuple[float, ...], b: tuple[float, ...], by: float) -> bool:
    """Whether the misses `a` are less than `b` by more than `by`, and none before it is more."""
    for miss_a, miss_b in zip(a, b, strict=True):
        if miss_a < miss_b - by:
            return True
        if miss_a > miss_b + min(by, tolerances.SAME_POSITION):
            return False
    return False
