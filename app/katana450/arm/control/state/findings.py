"""Findings on why the goal is not the target, most useful first, and the margins of a posture."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from katana450 import tolerances
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.maths.collision.engine import Contact
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import (
    ANGLE_WORTH_TELLING,
    POSITION_WORTH_TELLING,
    Projection,
)
from katana450.maths.kinematics.tracker import Tracked
from katana450.maths.kinematics.velocity import (
    limit_distances,
    limited_jog,
    nearest_limit,
    singular_values,
)
from katana450.maths.motion.arm_angle import elbow_path
from katana450.maths.motion.limiter import Limits

MIN_JOG_FRACTION = 0.05
"""Fraction of a jog below which the tool does not move noticeably."""

FULL_JOG_FRACTION = 0.9
"""Fraction of a jog above which no loss is reported."""

LEAST_PART = 1e-3
"""Rate of a joint [1] in a unit motion of the elbow from which on its limit counts."""

LIMIT_DISTANCE = math.radians(0.5)
"""[rad] Distance to a limit within which a joint holds up a jog."""


def of_limit(slides: tuple[bool, ...], axis: int, end: float) -> Finding:
    """Return the finding that ``axis`` is at its limit ``end`` [rad or m].

    slides: (n,) whether each joint is prismatic.
    """
    return Finding(Reason.SLIDE_LIMIT if slides[axis] else Reason.AXIS_LIMIT, end, axis)


def of_joints(limits: Limits, slides: tuple[bool, ...], q: FloatArray) -> tuple[Finding, ...]:
    """Return a finding for each joint of ``q`` (n,) [rad or m] that is beyond a limit.

    slides: (n,) whether each joint is prismatic.
    """
    below, above = (
        q < limits.lower - tolerances.LIMIT_SLACK,
        q > limits.upper + tolerances.LIMIT_SLACK,
    )
    # A slider at its end is converted to degrees and back: the slack covers the rounding.
    return tuple(
        of_limit(slides, axis, float((limits.lower if below[axis] else limits.upper)[axis]))
        for axis in np.flatnonzero(below | above).tolist()
    )


def of_projection(
    chain: Chain, best: Projection, priority: Priority, *, yaw_was_given: bool
) -> tuple[Finding, ...]:
    """Return the findings on what the nearest feasible pose ``best`` loses of the target.

    yaw_was_given: whether the target has a yaw, whose loss is reported.
    """
    findings = []
    in_place = best.position_error <= POSITION_WORTH_TELLING
    pitch_gave_way, roll_error = best.pitch_error > ANGLE_WORTH_TELLING, best.roll_error
    if not in_place:
        keeps_pitch = priority is Priority.PITCH and not pitch_gave_way
        reason = Reason.POSITION_CHANGED if keeps_pitch else Reason.OUT_OF_REACH
        findings.append(Finding(reason, best.position_error))
    if yaw_was_given and best.yaw_error > ANGLE_WORTH_TELLING:
        findings.append(Finding(Reason.YAW_FIXED, best.yaw_error))
    elif in_place and not pitch_gave_way:
        roll_error = max(roll_error, best.rotation_error)
    if roll_error > ANGLE_WORTH_TELLING:
        findings.append(Finding(Reason.ROLL_CHANGED, roll_error))
    if pitch_gave_way and (in_place or priority is Priority.PITCH):
        findings.append(Finding(Reason.PITCH_CHANGED, best.pitch_error))
    return (*findings, *causes_of(chain, best)) if findings else ()


def causes_of(chain: Chain, best: Projection, *, at_edge: bool = False) -> Iterator[Finding]:
    """Yield the findings on what keeps the tool of ``best`` from coming nearer to its target.

    ``at_edge``: whether the posture is at the edge of its branch.
    """
    if best.axis1:
        yield Finding(Reason.AXIS_1)
    if best.reach:
        yield Finding(Reason.LINKS)
    elif at_edge:
        yield Finding(Reason.SINGULAR)
    for axis in best.limits:
        ends = float(chain.lower[axis]), float(chain.upper[axis])
        yield of_limit(chain.slides, axis, min(ends, key=lambda end: abs(end - best.q[axis])))


def of_jog(chain: Chain, q: FloatArray, V: FloatArray) -> tuple[Finding, ...]:
    """Return the findings on what stops a jog at ``q`` (n,) [rad].

    V: twist (6,) of the jog in {S} [rad/s, m/s].
    """
    if limited_jog(chain, q, V) < MIN_JOG_FRACTION:
        return (Finding(Reason.SINGULAR),)
    near = limit_distances(chain, q) <= LIMIT_DISTANCE
    # Computed only near a limit, to keep the tick short.
    if not near.any() or limited_jog(chain, q, V, LIMIT_DISTANCE) > FULL_JOG_FRACTION:
        return ()
    ends = np.where(q - chain.lower < chain.upper - q, chain.lower, chain.upper)
    return tuple(
        of_limit(chain.slides, axis, float(ends[axis])) for axis in np.flatnonzero(near).tolist()
    )


def of_elbow(chain: Chain, q: FloatArray, rate: float) -> tuple[Finding, ...]:
    """Return the findings on what stops the elbow at ``q`` (7,) [rad] while the tool rests.

    rate: a rate of the arm angle [rad/s], of which the sign counts.
    """
    path = elbow_path(chain, q, rate)
    near = np.flatnonzero((path.rooms <= LIMIT_DISTANCE) & (np.abs(path.v) >= LEAST_PART))
    if near.size:
        ends = np.where(path.v > 0.0, chain.upper, chain.lower)
        return tuple(Finding(Reason.AXIS_LIMIT, float(ends[axis]), axis) for axis in near.tolist())
    return (Finding(Reason.ELBOW_END),) if path.end <= LIMIT_DISTANCE else ()


def of_tracked(chain: Chain, tracked: Tracked, priority: Priority) -> tuple[Finding, ...]:
    """Return the findings on what following a drag loses.

    The leap across a gap, which a drag never makes, comes first.
    """
    losses = of_projection(chain, tracked.best, priority, yaw_was_given=False)
    if tracked.beyond_gap is None:
        return losses
    axis, leap = tracked.leap_ahead()
    held = Finding(Reason.ACROSS_GAP, leap, axis)
    if tracked.beyond_gap.position_error <= POSITION_WORTH_TELLING:
        # The target beyond the gap can be reached, so it is not out of reach.
        losses = tuple(
            replace(f, reason=Reason.POSITION_CHANGED) if f.reason is Reason.OUT_OF_REACH else f
            for f in losses
        )
    return (held, *losses)


@dataclass(frozen=True, eq=False)
class Margins:
    """Distances of one posture from its boundaries.

    Attributes:
        limits: (n,) the distance of each axis to its nearer limit [rad]; negative beyond it.
        axis: the axis nearest to one of its limits, counted from 0, of those that turn.
        singular_values: (n,) those of the Jacobian over the characteristic length [1], in falling
            order.
        nearest: the nearest pair of parts; None if contacts are not checked.
    """

    limits: FloatArray
    axis: int
    singular_values: FloatArray
    nearest: Contact | None


def margins(chain: Chain, world: CollisionWorld | None, x: FloatArray) -> Margins:
    """Return the margins of one posture.

    Args:
        chain: the chain, which ends in the tool.
        world: the collision world; None to check no contacts.
        x: (n + 1,) the joints and the finger joint [rad].
    """
    q = x[: chain.n]
    nearest = None if world is None else world.nearest(x)
    limits = limit_distances(chain, q)
    return Margins(limits, nearest_limit(chain, limits), singular_values(chain, q), nearest)


class LogEntry(NamedTuple):
    """The start or the end of one finding, with the numbers it had then.

    Attributes:
        t: time [s] on the clock of the states.
        finding: the finding.
        began: True if the finding began; False if it ended.
    """

    t: float
    finding: Finding
    began: bool


def entries_between(before: State | None, after: State) -> tuple[LogEntry, ...]:
    """Return the entries for findings of ``before`` that ended and of ``after`` that began.

    A finding that stays makes no entry, even if its amount changes. Without ``before`` all begin.
    """
    earlier = () if before is None else before.findings
    old, new = ({_key(finding) for finding in findings} for findings in (earlier, after.findings))
    began = tuple(LogEntry(after.t, f, True) for f in after.findings if _key(f) not in old)
    ended = tuple(LogEntry(after.t, f, False) for f in earlier if _key(f) not in new)
    return (*ended, *began)


def _key(finding: Finding) -> tuple[Reason, int | None, tuple[str, str] | None]:
    return finding.reason, finding.axis, finding.parts
