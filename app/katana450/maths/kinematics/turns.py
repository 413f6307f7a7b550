"""The choice between angles that differ by whole turns. Angles in rad."""

from __future__ import annotations

import math

import numpy as np

from katana450 import tolerances
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain


def wrapped(theta: float) -> float:
    """Return `theta` wrapped to (-pi, pi]."""
    theta = math.remainder(theta, math.tau)
    return math.pi if theta == -math.pi else theta


def in_turn(theta: float, lower: float, upper: float) -> float:
    """Return `theta` in the turn between the limits if there is one, else in (-pi, pi]."""
    theta = wrapped(theta)
    lower, upper = lower - tolerances.LIMIT_SLACK, upper + tolerances.LIMIT_SLACK
    if lower <= theta <= upper:
        return theta
    # The first turn that is not beyond the violated limit.
    turns = math.ceil((lower - theta) / math.tau)
    if theta > upper:
        turns = math.floor((upper - theta) / math.tau)
    turned = theta + math.tau * turns
    return turned if lower <= turned <= upper else theta


def in_limits_turns(chain: Chain, q: FloatArray) -> FloatArray:
    """Return `q` (..., n) [rad], each angle in the turn inside its limits, else in [-pi, pi]."""
    turns = np.round(q / math.tau)
    q = q - math.tau * (np.where(chain.slides, 0.0, turns) if any(chain.slides) else turns)
    lower, upper = chain.lower - tolerances.LIMIT_SLACK, chain.upper + tolerances.LIMIT_SLACK
    if max(-lower.min(), upper.max()) <= math.pi:
        return q
    # The first turn that is not beyond the violated limit.
    turns = np.where(q < lower, np.ceil((lower - q) / math.tau), 0.0)
    turns = np.where(q > upper, np.floor((upper - q) / math.tau), turns)
    other = q + math.tau * turns
    return np.where((other >= lower) & (other <= upper), other, q)


def nearest_turn(chain: Chain, q: FloatArray, hint: FloatArray | None) -> FloatArray:
    """Return `q` (..., n), each angle in the turn nearest to `hint` (n,) inside its limits.

    Only limits of a turn and wider leave this choice. An angle without such a turn stays.
    """
    slack = tolerances.LIMIT_SLACK
    wide = (chain.upper - chain.lower >= math.tau - slack) & ~np.array(chain.slides)
    if hint is None or not wide.any():
        return q
    first = np.ceil((chain.lower - slack - q) / math.tau)
    last = np.floor((chain.upper + slack - q) / math.tau)
    turns = np.minimum(np.maximum(np.round((hint - q) / math.tau), first), last)
    return np.where(wide & (first <= last), q + math.tau * turns, q)


def near_turns(chain: Chain, q: FloatArray, near: FloatArray) -> FloatArray:
    """Return `q` (n,) [rad], each angle in the turn nearest to ``near`` inside its limits."""
    turns = np.round((near - q) / math.tau)
    q = q + math.tau * (np.where(chain.slides, 0.0, turns) if any(chain.slides) else turns)
    slack = tolerances.LIMIT_SLACK
    for turn in (math.tau, -math.tau):
        outside = (q < chain.lower - slack) | (q > chain.upper + slack)
        other = q + turn
        fits = outside & (other >= chain.lower - slack) & (other <= chain.upper + slack)
        q = np.where(fits, other, q)
    return q


def another_turn_helps(lower: float, upper: float) -> bool:
    """Return whether an angle in [-pi, pi] may be inside the limits [rad] after a whole turn.

    It can only be beyond one limit then, and the other one beyond a half turn.
    """
    slack = tolerances.LIMIT_SLACK
    return (lower <= slack - math.pi) != (upper >= math.pi - slack)
