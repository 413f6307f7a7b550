"""Following a dragged target: the goal moves on from its present place, or holds.

The nearest feasible pose can leap while the target creeps: the limits split the pitches that reach
a point into two ranges, axis 1 has a gap, and over axis 1 the arm would have to turn round. The
nearest pose is therefore taken only if it is one hop from the goal. Elsewhere the tracker searches
within a hop, repeatedly, each time from the last pose found. This never leads away from the target,
slides along obstacles, and stops where only a leap would bring the tool nearer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import Five, FiveAxisArm
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.canonical_target import CanonicalTarget
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.nearest_posture import NearestPosture, nearest_posture
from katana450.maths.kinematics.planar import Interval, LimitedArm
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection, measured
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.turns import wrapped

HOP: Final = 0.1
"""Maximum step of an axis [rad]: the motion of a joint in a twelfth of a second, so that an
operator sees motion and no leap.
"""

DRAG_STRIDE: Final = 0.01
"""Step length [m] along the path of a fast drag: half a hop of the joints of a small arm."""

MAX_PATH_LENGTH: Final = 32
"""Maximum number of strides along one drag; a longer drag takes longer strides."""

MAX_DISTANCE_RATIO: Final = 16.0
"""Maximum distance of a target, in reaches of the arm [1]. Of a target farther away only the
direction counts, which bounds the length of every path.
"""

MAX_POSES: Final = 18
"""Maximum number of searches in one call. The next call continues: the joints need several ticks
for a hop, so the goal stays ahead of them.
"""

MAX_POSES_OUT_OF_REACH: Final = 3
"""Effort of a search for a target out of reach, in searches."""

MAX_POSES_PER_STRIDE: Final = 2 * MAX_POSES_OUT_OF_REACH
"""Effort for the hops of one stride: two hops are enough without an obstacle."""

MIN_HOPS_PER_STRIDE: Final = 3
"""Minimum number of hops of one stride, whatever their effort. Beside the roll axis one hop takes
many searches, and a goal that falls behind the hand loses the pitch.
"""

MIN_HOP_GAIN: Final = 1e-6
"""Smallest gain [m], [rad] of a hop; less is rounding."""

MIN_LEAP_GAIN: Final = 5e-5
"""Smallest gain [m], [rad] of a leap that is reported: half of the arm's precision."""


@dataclass(frozen=True, eq=False)
class Tracked:
    """The next pose of the goal, and the pose that only a leap would reach.

    Attributes:
        best: the pose to move to.
        beyond_gap: the better pose beyond a gap. None when `best` is as near as the arm comes on
            its branch, or when the search is not complete.
        since: the place on the target's path up to which the target has been followed, when hops
            lead nearer than `best`. The next call continues from there.
    """

    best: Projection
    beyond_gap: Projection | None = None
    since: ToolTarget | None = None

    def leap_ahead(self) -> tuple[int, float]:
        """Return the axis (from 0) that would leap farthest to the pose beyond the gap.

        Also returns the angle of the leap [rad].
        """
        assert self.beyond_gap is not None
        turns = np.abs(self.beyond_gap.q - self.best.q)
        return int(turns.argmax()), float(turns.max())


def track(
    chain: Chain,
    q: npt.ArrayLike,
    target: ToolTarget,
    *,
    branch: Branch,
    priority: Priority = Priority.POSE,
    since: ToolTarget | None = None,
) -> Tracked:
    """Move the goal from `q` (5,) [rad] on `branch`, inside the limits, towards `target`.

    The goal never changes branch. A stride of the target moves an axis of the goal by more than a
    hop only along a path on which each hop brings it nearer. One call takes bounded time: see
    `Tracked.since`.

    Args:
        chain: the arm.
        q: joint angles (5,) [rad] of the goal.
        target: the target.
        branch: the branch of the goal.
        priority: the part of the target that is kept.
        since: the target when the goal became `q`. A drag from there that is longer than a stride
            is followed along its straight path.
    """
    limited = LimitedArm.of(chain)
    alpha = limited.arm.angles(chain.clamp(q))
    canonical = target.canonical(limited.arm, priority)
    nearest = nearest_posture(limited, canonical, branch, alpha)
    if _within_hop(alpha, nearest.alpha):
        return Tracked(
            _projection(chain, target, canonical, _not_away(limited.arm, alpha, canonical, nearest))
        )
    # One hop at least, so that the loop ends.
    effort = max(MAX_POSES - _effort(nearest), 1)
    ends = () if since is None else (_near(limited.arm, since), _near(limited.arm, target))
    for stop in stops_between(*ends) if ends else ():
        stop_target = stop.canonical(limited.arm, priority)
        pursuit = _Pursuit(
            limited, stop_target, nearest_posture(limited, stop_target, branch, alpha)
        )
        posture = pursuit.follow(alpha, MAX_POSES_PER_STRIDE)
        alpha, effort = posture.alpha, effort - _effort(pursuit.best) - pursuit.effort
        if effort <= 0:
            return Tracked(_projection(chain, target, canonical, posture), since=stop)
    pursuit = _Pursuit(limited, canonical, nearest)
    posture = pursuit.follow(alpha, effort)
    best = _projection(chain, target, canonical, posture)
    if not pursuit.ended:
        return Tracked(best, since=target)
    miss, miss_ahead = (_misses(limited.arm, canonical, s.alpha) for s in (posture, nearest))
    if not _nearer(miss_ahead, miss, MIN_LEAP_GAIN):
        return Tracked(best)
    return Tracked(best, beyond_gap=_projection(chain, target, canonical, nearest))


def leap(
    chain: Chain, q: FloatArray, target: ToolTarget, branch: Branch, priority: Priority
) -> Projection:
    """Return the nearest pose to `target` on `branch`, at any distance from the goal.

    `q` (5,) [rad] is the goal. Pitch and roll are taken in the plane in which the arm ends. Errors
    as for `project`.
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
    """Return the projection of `target` that `found_posture` gives."""
    sign = LimitedArm.of(chain).arm.signs[0]
    return measured(
        chain, target.pose(chain, sign * found_posture.alpha[0]), canonical, found_posture
    )


def _near(arm: FiveAxisArm, target: ToolTarget) -> ToolTarget:
    """Return `target`, moved towards the origin to the maximum distance if it is beyond."""
    far = math.hypot(*target.position) / (MAX_DISTANCE_RATIO * arm.reach)
    return target if far <= 1.0 else replace(target, position=target.position / far)


def stops_between(since: ToolTarget, target: ToolTarget) -> Iterator[ToolTarget]:
    """Return the stops of a drag, one stride apart, without the ends of its path."""
    distance, angle = since.apart(target)
    count = math.ceil(min(max(distance / DRAG_STRIDE, angle / HOP), MAX_PATH_LENGTH))
    return (since.towards(target, i / count) for i in range(1, count))


class _Pursuit:
    """The search in hops for `canonical`, whose nearest pose is `best`.

    Attributes:
        effort: the effort of the hops so far.
        ended: True if no further hop would lead nearer.
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
        """Return `best` if it is a hop away, else the end of the hops from `alpha`.

        `maximum` is the maximum effort of the hops after the first MIN_HOPS_PER_STRIDE.
        """
        arm = self.limited.arm
        posture, miss, hops = None, _misses(arm, self.canonical, alpha), 0
        while not self.ended and (self.effort < maximum or hops < MIN_HOPS_PER_STRIDE):
            hops += 1
            if _within_hop(alpha, self.best.alpha):
                posture, self.ended = _not_away(arm, alpha, self.canonical, self.best), True
                break
            hop = _hop(self.limited, alpha, self.canonical, self.best.branch)
            self.effort += _effort(hop)
            hop_miss = _misses(arm, self.canonical, hop.alpha)
            worthwhile = _nearer(hop_miss, miss, MIN_HOP_GAIN)
            # If the bounds of the hop do not bind, another hop would lead nowhere.
            self.ended = not worthwhile or _within(HOP * (1.0 - MIN_HOP_GAIN), alpha, hop.alpha)
            if worthwhile or (posture is None and not _nearer(miss, hop_miss, tolerances.ROUNDING)):
                posture, alpha, miss = hop, hop.alpha, hop_miss
            else:
                # The goal stays, with the constraints that bind the hop.
                posture = hop._replace(alpha=alpha)
        assert posture is not None
        return posture


def _effort(found_posture: NearestPosture) -> int:
    """Return the effort of a search, larger for a target out of reach."""
    reached = found_posture.position_error <= tolerances.SAME_POSITION
    return found_posture.searches * (1 if reached else MAX_POSES_OUT_OF_REACH)


def _not_away(
    arm: FiveAxisArm, alpha: Five, canonical: CanonicalTarget, best: NearestPosture
) -> NearestPosture:
    """Return `best`, but stay at `alpha` if `best` is an approximation that is farther away."""
    if arm.off_axis == 0.0:
        return best
    miss, miss_best = (_misses(arm, canonical, angles) for angles in (alpha, best.alpha))
    away = _nearer(miss, miss_best, tolerances.SAME_POSITION)
    return best._replace(alpha=alpha) if away else best


def _hop(
    limited: LimitedArm, alpha: Five, canonical: CanonicalTarget, branch: Branch
) -> NearestPosture:
    """Return the nearest pose with every axis within a hop of `alpha`."""
    arm = limited.arm
    theta1 = _theta1(limited, alpha[0], canonical, branch)
    if canonical.priority is Priority.PITCH:
        # The pitch comes first, and no posture within a hop differs more in pitch.
        pitch = arm.pitch(alpha)
        turn = wrapped(canonical.pitch(alpha[0]) - pitch)
        canonical = canonical.pitched(arm, pitch + min(max(turn, -HOP), HOP))
    return nearest_posture(limited.near(alpha, HOP, theta1), canonical, branch, alpha)


def _theta1(
    limited: LimitedArm, theta1: float, canonical: CanonicalTarget, branch: Branch
) -> Interval:
    """Return the range of axis 1 within a hop of `theta1`, in the direction that leads nearer."""
    facing = canonical.facing(limited.arm, branch.shoulder)
    if facing is None:
        return Interval(theta1, theta1)
    turn = wrapped(facing - theta1)
    aside = canonical.aside(limited.arm)
    if aside != 0.0:
        # A plane beside axis 1 comes nearer in one direction of turning, even if that is the longer
        # one.
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
    """Return the errors [m], [rad] of `alpha`, in the order of the priority."""
    position = math.dist(arm.tool_point(alpha), canonical.tool)
    pitch, roll = arm.pitch(alpha), alpha[4]
    if canonical.priority is Priority.POSE:
        return position, canonical.orientation.angle(pitch, roll)
    target_pitch, target_roll = canonical.orientation.best()
    pitch, roll = abs(wrapped(pitch - target_pitch)), abs(wrapped(roll - target_roll))
    if canonical.priority is Priority.PITCH:
        return pitch, position, roll
    return position, pitch, roll


def _nearer(a: tuple[float, ...], b: tuple[float, ...], by: float) -> bool:
    """Return True if the errors `a` are less than `b` by more than `by`, in order of priority.

    An earlier error that is larger makes the result False.
    """
    for miss_a, miss_b in zip(a, b, strict=True):
        if miss_a < miss_b - by:
            return True
        if miss_a > miss_b + min(by, tolerances.SAME_POSITION):
            return False
    return False
