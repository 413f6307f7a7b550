"""The difference of the setpoints of a run from the recorded ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, IntArray

AT_START = 1e-6
"""[rad] Distance from the recorded start at which a run counts as there."""

WINDOW = 0.05
"""[rad] How far along the path, plus that fraction of it, the corresponding place is sought."""


class PathDifference(NamedTuple):
    """The difference of two motions along the same path.

    Attributes:
        joints: largest difference of a joint at corresponding places [rad].
        duration: time of the run from the recorded start to the recorded end [s].
    """

    joints: float
    duration: float


def path_difference(recorded: FloatArray, t: FloatArray, run: FloatArray) -> PathDifference:
    """Return how far a run lies from the recorded path, at any speed and with any rests.

    Each setpoint of one motion is compared with the nearest place of the other one that is about as
    far along the path, straight between its setpoints. The larger difference of both directions
    counts. What the run does before it reaches the recorded start is left out.

    Args:
        recorded: (N, n) recorded setpoints [rad].
        t: (M,) times of the run [s].
        run: (M, n) its setpoints [rad].
    """
    away = np.abs(run - recorded[0]).max(axis=1)
    near = np.flatnonzero(away <= AT_START)
    begin = int(near[0]) if len(near) else int(np.argmin(away))
    # The last place of rest before the motion.
    while begin + 1 < len(run) and np.array_equal(run[begin + 1], run[begin]):
        begin += 1
    one, _ = _moving(recorded)
    other, kept = _moving(run[begin:])
    apart = max(_farthest(one, other), _farthest(other, one))
    return PathDifference(apart, float(t[begin + kept[-1]] - t[begin]))


def _moving(q: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the rows of ``q`` without repetitions, and their indices."""
    kept = np.flatnonzero(np.append(True, np.abs(np.diff(q, axis=0)).max(axis=1) > 0.0))
    return q[kept], kept


def _farthest(one: FloatArray, other: FloatArray) -> float:
    """Return the largest distance [rad] of a row of ``one`` from the path through ``other``."""
    if len(other) < 2:
        return float(np.abs(one - other[0]).max())
    along, path = _lengths(one), _lengths(other)
    legs = np.diff(other, axis=0)
    squared = np.maximum((legs * legs).sum(axis=1), np.finfo(float).tiny)
    reach = WINDOW + WINDOW * along
    high = np.minimum(np.searchsorted(path, along + reach) + 1, len(legs))
    low = np.clip(np.searchsorted(path, along - reach) - 1, 0, high - 1)
    farthest = 0.0
    for row, first, last in zip(one, low.tolist(), high.tolist(), strict=True):
        starts, steps = other[first:last], legs[first:last]
        fraction = ((row - starts) * steps).sum(axis=1) / squared[first:last]
        nearest = starts + np.clip(fraction, 0.0, 1.0)[:, None] * steps
        farthest = max(farthest, float(np.abs(nearest - row).max(axis=1).min()))
    return farthest


def _lengths(q: FloatArray) -> FloatArray:
    """Return the distance (N,) along ``q`` (N, n) [rad], by the joint that turns most."""
    return np.append(0.0, np.cumsum(np.abs(np.diff(q, axis=0)).max(axis=1)))
