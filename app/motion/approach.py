"""Approach a goal in joint space, never faster than the joints can."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray


def approach(q: FloatArray, goal: FloatArray, speed: FloatArray, dt: float) -> FloatArray:
    """One step from ``q`` towards ``goal`` along the straight line between them.

    All joints arrive together: the one that needs longest runs at its limit and the others are
    scaled to it, so the shape of the motion does not depend on ``dt``.

    Args:
        q: (n,) present position [rad].
        goal: (n,) wanted position [rad].
        speed: (n,) greatest speed of each joint [rad/s], positive.
        dt: time since ``q`` was commanded [s]; nothing moves when it is not positive.

    Returns:
        (n,) the next position; exactly ``goal`` once it is within one step.
    """
    if dt <= 0.0:
        return q
    way = goal - q
    time_needed = float(np.max(np.abs(way) / speed))
    if time_needed <= dt:
        return goal
    return np.asarray(q + way * (dt / time_needed))
