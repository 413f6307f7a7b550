"""Findings on what a posture loses of its target, for arms outside the five-axis family."""

from __future__ import annotations

from collections.abc import Iterator

from katana450.arm.control.state import Finding, Reason
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import (
    ANGLE_WORTH_TELLING,
    POSITION_WORTH_TELLING,
    Projection,
)


def losses_of(
    chain: Chain,
    best: Projection,
    priority: Priority,
    *,
    at_edge: bool,
    gap: tuple[int, float] | None = None,
) -> Iterator[Finding]:
    """Yield the findings on ``best``, most useful first.

    ``at_edge``: whether its posture is at the edge of its branch. ``gap``: the axis that would
    leap, from 0, and the angle of its leap [rad], if only a leap leads nearer.
    """
    off = best.position_error > POSITION_WORTH_TELLING
    turned = priority is not Priority.POSITION and best.rotation_error > ANGLE_WORTH_TELLING
    if gap is not None:
        yield Finding(Reason.ACROSS_GAP, gap[1], gap[0])
    if off:
        kept = priority is Priority.ORIENTATION and not turned
        # It is out of reach only if that is shown: by the links, or by a limit.
        kept = kept or gap is not None or not (best.reach or best.limits)
        reason = Reason.POSITION_CHANGED if kept else Reason.OUT_OF_REACH
        yield Finding(reason, best.position_error)
    if turned:
        yield Finding(Reason.ORIENTATION_CHANGED, best.rotation_error)
    if not (off or turned) or gap is not None:
        return
    if best.reach:
        yield Finding(Reason.LINKS)
    elif at_edge:
        yield Finding(Reason.SINGULAR)
    for axis in best.limits:
        ends = float(chain.lower[axis]), float(chain.upper[axis])
        yield Finding(Reason.AXIS_LIMIT, min(ends, key=lambda end: abs(end - best.q[axis])), axis)
