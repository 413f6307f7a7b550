"""Following a target that a hand drags: the goal goes on from where it is, or holds.

The nearest feasible pose can leap while the target creeps: the limits split the pitches that reach
a point in two ranges, axis 1 has a gap, and over axis 1 the arm would have to turn round. So the
nearest pose is only taken where it is one hop from the goal. Elsewhere it is sought within a hop,
again and again, each time from the pose found last: that never leads away from the target, slides
along what is in the way, and stops where only a leap would bring the tool nearer.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np
import numpy.typing as npt

from app import tolerances
from app.geometry.arrays import FloatArray
from app.kinematics.arm import arm_of
from app.kinematics.branch import Branch
from app.kinematics.chain import Chain
from app.kinematics.freedoms import pitch_and_roll, tool_pose
from app.kinematics.projection import Projection, project
from app.kinematics.reading import Reading, nearest
from app.kinematics.tool import ToolTarget
from app.kinematics.turns import wrapped

HOP: Final = 0.1
"""[rad] How far an axis may go at once: what the joints do in a twelfth of a second, so that a
person sees motion and no leap."""

STRIDE: Final = 0.02
"""[m] A faster drag is followed along its way in strides: about a hop of the joints."""

LONGEST_WAY: Final = 16
"""Strides along one drag; a longer one takes longer strides."""

MOST_HOPS: Final = 24
"""Hops to one target. What is farther is reached with the next move of the hand."""

WORTH_A_HOP: Final = 1e-6
"""[m], [rad] Coming nearer by less is rounding."""

WORTH_A_LEAP: Final = 5e-5
"""[m], [rad] A leap that brings the tool nearer by less than half of the arm's precision is not
missed."""

ELBOW: Final = 2
"""The axis that needs no bound: with the others in bounds it follows from where the tool point is,
and its range has to hold the stretched arm."""


class Tracking(Enum):
    """How the goal stands to the target."""

    OK = "ok"
    LIMITED = "limited"
    HELD = "held"


@dataclass(frozen=True, eq=False)
class Tracked:
    """Where the goal goes, and what it would take a leap to get.

    best: the pose to go to. ahead: the better pose beyond a gap, or None when `best` is as near as
    the arm comes on its branch.
    """

    best: Projection
    ahead: Projection | None

    @property
    def status(self) -> Tracking:
        """HELD when a better pose lies beyond a gap, OK when nothing is given up."""
        if self.ahead is not None:
            return Tracking.HELD
        given_up = max(self.best.position_error, self.best.rotation_error)
        return Tracking.LIMITED if given_up > WORTH_A_LEAP else Tracking.OK

    def leap_ahead(self) -> tuple[int, float]:
        """The axis (from 0) that would leap farthest to the pose ahead, and how far [rad]."""
        if self.ahead is None:
            return 0, 0.0
        way = np.abs(self.ahead.q - self.best.q)
        return int(way.argmax()), float(way.max())


def track(
    chain: Chain,
    q: npt.ArrayLike,
    target: ToolTarget,
    *,
    branch: Branch,
    reading: Reading = Reading.POSE,
    since: ToolTarget | None = None,
) -> Tracked:
    """From the goal `q` (5,) [rad] on `branch`, inside the limits, on towards `target`.

    since: where the target was when the goal became `q`; a drag from there that is longer than a
    stride is followed along its straight way. The goal never changes branch, and a stride of the
    target moves the goal by more than a hop an axis only along a way on which each hop brings it
    nearer. An arm with offsets goes to the nearest pose at once: hops are for straight arms.
    """
    q = chain.clamp(q)
    ahead = leap(chain, q, target, branch, reading)
    if _within_hop(q, ahead) or not arm_of(chain).is_straight:
        return Tracked(ahead, None)
    for stop in () if since is None else _way(since, target):
        best = leap(chain, q, stop, branch, reading)
        q = _pursue(chain, q, stop, best, reading, hops=2).q
    found = _pursue(chain, q, target, ahead, reading, hops=MOST_HOPS)
    return Tracked(
        found, ahead if _nearer(chain, ahead, found, target, reading, WORTH_A_LEAP) else None
    )


def leap(
    chain: Chain, q: FloatArray, target: ToolTarget, branch: Branch, reading: Reading
) -> Projection:
    """The nearest pose to `target` on `branch`, however far from the goal `q` (5,) [rad].

    Pitch and roll are taken in the plane the arm comes to stand in. Errors as of `project`.
    """
    if not arm_of(chain).is_straight:
        place, pitch, roll = target.position, target.pitch, target.roll
        T = tool_pose(chain, place, pitch, roll, branch.shoulder, q)
        return project(chain, T, branch=branch, q_hint=q)
    theta1 = _in_limits(chain, target.facing(branch, float(q[0])), float(q[0]))
    return nearest(chain, target.pose(chain, theta1), reading, branch=branch, q_hint=q)


def _way(since: ToolTarget, target: ToolTarget) -> Iterator[ToolTarget]:
    """The stops of the drag, without its ends."""
    strides = max(
        math.dist(since.position, target.position) / STRIDE,
        abs(target.pitch - since.pitch) / HOP,
        abs(target.roll - since.roll) / HOP,
    )
    count = math.ceil(min(strides, LONGEST_WAY))
    return (since.towards(target, i / count) for i in range(1, count))


def _pursue(
    chain: Chain, q: FloatArray, target: ToolTarget, best: Projection, reading: Reading, hops: int
) -> Projection:
    """The nearest pose, `best`, if it is a hop away, else where at most `hops` hops lead."""
    found: Projection | None = None
    for _ in range(hops):
        if _within_hop(q, best):
            return best
        hop = _hop(chain, q, target, best.branch, reading)
        if found is not None and not _nearer(chain, hop, found, target, reading, WORTH_A_HOP):
            return found
        way = np.abs(hop.q - q)
        way[ELBOW] = 0.0
        found, q = hop, hop.q
        if way.max() < HOP * (1.0 - WORTH_A_HOP):
            # Not the bounds of the hop hold it there: another one would lead nowhere.
            return found
    return best if found is None else found


def _hop(
    chain: Chain, q: FloatArray, target: ToolTarget, branch: Branch, reading: Reading
) -> Projection:
    """The nearest pose with every axis within a hop of `q`."""
    turn = wrapped(target.facing(branch, float(q[0])) - float(q[0]))
    if abs(turn) > 0.5 * math.pi:
        # The target is behind the tool point's side of axis 1, and no small turn brings it nearer.
        turn = 0.0
    theta1 = float(np.clip(q[0] + np.clip(turn, -HOP, HOP), chain.lower[0], chain.upper[0]))
    lower, upper = np.maximum(chain.lower, q - HOP), np.minimum(chain.upper, q + HOP)
    lower[ELBOW], upper[ELBOW] = chain.lower[ELBOW], chain.upper[ELBOW]
    lower[0], upper[0] = theta1, math.nextafter(theta1, math.inf)
    near = dataclasses.replace(chain, lower=lower, upper=upper)
    if reading is Reading.PITCH:
        # The pitch comes first, and no posture within a hop has one that is farther away.
        pitch, _ = pitch_and_roll(chain, q)
        turn = min(max(wrapped(target.pitch - pitch), -HOP), HOP)
        target = dataclasses.replace(target, pitch=pitch + turn)
    found = nearest(near, target.pose(chain, theta1), reading, branch=branch, q_hint=q)
    # The bounds of the hop are no limits of the arm.
    gap = np.minimum(np.abs(found.q - chain.lower), np.abs(found.q - chain.upper))
    at_limit = tuple(i for i in found.limits if gap[i] <= tolerances.LIMIT_SLACK)
    return dataclasses.replace(found, limits=at_limit)


def _in_limits(chain: Chain, theta1: float, now: float) -> float:
    """`theta1` in the turn inside the limits of axis 1, else the limit nearest to `now` [rad]."""
    lower, upper = float(chain.lower[0]), float(chain.upper[0])
    for turned in (theta1, theta1 - math.tau, theta1 + math.tau):
        if lower <= turned <= upper:
            return turned
    return min((lower, upper), key=lambda end: abs(end - now))


def _within_hop(q: FloatArray, found: Projection) -> bool:
    return bool(np.abs(found.q - q).max() <= HOP)


def _nearer(
    chain: Chain, a: Projection, b: Projection, target: ToolTarget, reading: Reading, by: float
) -> bool:
    """Whether `a` misses less of `target` than `b`, what counts most first."""
    misses_a, misses_b = (_misses(chain, found, target, reading) for found in (a, b))
    for miss_a, miss_b in zip(misses_a, misses_b, strict=True):
        if abs(miss_a - miss_b) > by:
            return miss_a < miss_b
    return False


def _misses(
    chain: Chain, found: Projection, target: ToolTarget, reading: Reading
) -> tuple[float, ...]:
    if reading is Reading.POSE:
        return found.position_error, found.rotation_error
    pitch, roll = pitch_and_roll(chain, found.q)
    pitch, roll = abs(wrapped(pitch - target.pitch)), abs(wrapped(roll - target.roll))
    if reading is Reading.PITCH:
        return pitch, found.position_error, roll
    return found.position_error, pitch, roll
