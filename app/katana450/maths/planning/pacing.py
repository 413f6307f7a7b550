"""Search for the scaling that runs through a path in the shortest time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.path import Path, joint_derivatives, point_derivatives
from katana450.maths.planning.scaling import CUBIC, Bounds, Scaling, rest_to_rest

KNOTS: Final = 20
"""Number of pieces of the slowness; each join of the path adds half as many."""

SAMPLES_PER_PIECE: Final = 16
"""Number of checked places in each piece; LIMIT_FRACTION covers what lies between them."""

LIMIT_FRACTION: Final = 0.995
"""Fraction [1] of every limit that is used."""

ROUNDS: Final = 50
"""Number of rounds that make a path slower where it is too fast and faster where it is not."""

TRIAL_ROUNDS: Final = 8
"""The number of rounds that compare other values of a and j."""

SLOWING_POWER: Final = 0.6
"""Power [1] of the excess of a place, by which it is slowed in one round."""

SPEEDING_POWER: Final = 0.1
"""Power [1] for a place that is too slow: smaller, or the rounds would oscillate."""

SMALLEST_DIVISOR: Final = 1e-300
"""Smallest divisor, which avoids 0 / 0."""

SEARCH_FACTORS: Final = (2.0, 1.4, 1.18, 1.08)
"""Falling factors [1] by which a and j are varied, as long as it saves time."""


def fastest(path: Path, bounds: Bounds) -> Scaling:
    """Return the fastest scaling of `path` found that keeps to `bounds`.

    For given a and j each coefficient of the slowness is raised while a limit is exceeded near it,
    and lowered while no limit is reached. All coefficients are then made slower by the remaining
    excess. a and j are sought on a pattern that narrows. The result is near the optimum; tests show
    how near.
    """
    sampled = _Sampled.of(path, bounds)
    joints = bounds.joints
    a = float((joints.acceleration / joints.speed).min())
    j = float((joints.jerk / joints.speed).min())
    even = np.ones(len(sampled.first) + 3)
    # Uniform slowness, or the slowness that each place needs by itself: either may end up better.
    starts = even, sampled.near(sampled.excess(even, a, j))
    best = min((sampled.fitted(a, j, each, ROUNDS) for each in starts), key=lambda f: f.time)
    for factor in SEARCH_FACTORS:
        improved = True
        while improved:
            improved = False
            for x, y in ((1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1)):
                fa, fj = factor**x, factor**y
                a, j = best.acceleration * fa, best.jerk * fj
                other = sampled.fitted(a, j, best.coefficients, TRIAL_ROUNDS)
                if other.time < (1.0 - 1e-3) * best.time:
                    best, improved = other, True
    best = sampled.fitted(best.acceleration, best.jerk, best.coefficients, ROUNDS)
    return Scaling(best.coefficients, best.acceleration, best.jerk)


@dataclass(frozen=True, eq=False)
class _Fitted:
    coefficients: FloatArray
    acceleration: float
    jerk: float
    time: float


@dataclass(frozen=True, eq=False)
class _Sampled:
    """A path at many places.

    Attributes:
        q: derivatives (3, N, 5) of the joints by sigma.
        p: derivatives (2, N, 3) of the tool point by sigma.
        piece: number (N,) of the piece of the slowness at each place.
        weights: weights (3, N, 4) of its four coefficients for the slowness and its first two
            derivatives.
        first: index (K,) of the first place in each piece.
        bounds: the limits of the motion.
    """

    q: FloatArray
    p: FloatArray
    piece: npt.NDArray[np.int64]
    weights: FloatArray
    first: npt.NDArray[np.int64]
    bounds: Bounds

    @staticmethod
    def of(path: Path, bounds: Bounds) -> _Sampled:
        count = KNOTS + (KNOTS // 2) * len(path.joins)
        even = np.linspace(0.0, 1.0, count * SAMPLES_PER_PIECE + 1)
        # Add places on either side of a join, where the third derivative leaps.
        joins = np.array(path.joins)
        sigma = np.unique(np.concatenate((even, joins - 1e-12, joins + 1e-12)))
        piece = np.minimum((sigma * count).astype(np.int64), count - 1)
        fraction = sigma * count - piece
        powers = np.stack((np.ones_like(fraction), fraction, fraction**2, fraction**3))
        zero = np.zeros_like(fraction)
        slopes = np.stack((zero, zero + count, 2.0 * count * fraction, 3.0 * count * fraction**2))
        bends = np.stack((zero, zero, zero + 2.0 * count**2, 6.0 * count**2 * fraction))
        weights = np.stack([each.T @ CUBIC for each in (powers, slopes, bends)])
        return _Sampled(
            joint_derivatives(path, sigma)[1:],
            point_derivatives(path, sigma)[1:3],
            piece,
            weights,
            np.searchsorted(piece, np.arange(count)),
            bounds,
        )

    def fitted(self, a: float, j: float, start: FloatArray, rounds: int) -> _Fitted:
        """Return the least slowness found for the bounds `a` and `j` of tau(t).

        The search begins with `start` (K + 3,).
        """
        c = start * self.excess(start, a, j).max()
        best, minimum = c, np.inf
        for _ in range(rounds):
            checkpoint()
            excess = self.excess(c, a, j)
            maximum = float(excess.max())
            # tau at the end, if the whole path is slowed until nothing is too fast.
            time = rest_to_rest(maximum * self._span(c), a, j)
            if time < minimum:
                best, minimum = maximum * c, time
            near = self.near(excess)
            c = c * np.where(near > 1.0, near**SLOWING_POWER, near**SPEEDING_POWER)
        return _Fitted(best, a, j, minimum)

    def near(self, excess: FloatArray) -> FloatArray:
        """Return the maximum of `excess` (N,) near each coefficient, (K + 3,).

        A coefficient affects four pieces.
        """
        worst = np.maximum.reduceat(excess, self.first)
        padded = np.concatenate((np.zeros(3), worst, np.zeros(3)))
        return np.asarray(np.lib.stride_tricks.sliding_window_view(padded, 4).max(axis=1))

    @staticmethod
    def _span(c: FloatArray) -> float:
        total = c.sum() - (23.0 * (c[0] + c[-1]) + 12.0 * (c[1] + c[-2]) + c[2] + c[-3]) / 24.0
        return float(total) / (len(c) - 3)

    def excess(self, c: FloatArray, a: float, j: float) -> FloatArray:
        """Return the factor (N,) by which each place must be slower to keep every limit."""
        limits, bounds = self.bounds.joints, self.bounds
        fours = np.stack([c[self.piece + k] for k in range(4)], axis=1)
        w, w1, w2 = (np.einsum("nk,nk->n", fours, each) for each in self.weights)
        first = 1.0 / w
        second = -w1 * first**3
        third = (3.0 * w1 * w1 * first - w2) * first**4
        f, s, t = first[:, None], second[:, None], third[:, None]
        q1, q2, q3 = self.q
        speed = np.abs(q1) * f
        bend = np.abs(q2 * f * f + q1 * s)
        jerk = np.abs(q3 * f**3 + 3.0 * q2 * f * s + q1 * t)
        spare = LIMIT_FRACTION
        found = (speed / (spare * limits.speed)).max(axis=1)
        A, J = spare * limits.acceleration, spare * limits.jerk
        np.maximum(found, _quadratic(bend / A, a * speed / A).max(axis=1), out=found)
        cubic = _cubic(jerk / J, 3.0 * a * bend / J, j * speed / J)
        np.maximum(found, cubic.max(axis=1), out=found)
        p1, p2 = self.p
        moved = np.sqrt(np.einsum("nk,nk->n", p1, p1)) * first
        np.maximum(found, moved / (spare * bounds.tool_speed), out=found)
        if bounds.tool_acceleration is not None:
            pushed = p2 * f * f + p1 * s
            push = np.sqrt(np.einsum("nk,nk->n", pushed, pushed)) / bounds.tool_acceleration
            pull = a * moved / bounds.tool_acceleration
            np.maximum(found, _quadratic(push / spare, pull / spare), out=found)
        return np.asarray(found)


def _quadratic(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the r > 0 with x / r^2 + y / r = 1."""
    return np.asarray(0.5 * (y + np.sqrt(y * y + 4.0 * x)))


def _cubic(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Return the r > 0 with x / r^3 + y / r^2 + z / r = 1.

    The value is approached from above, so that no limit is exceeded.
    """
    # r^3 - z r^2 - y r - x is convex and rises beyond its root, and the start is beyond it.
    r = np.cbrt(x) + np.sqrt(y) + z
    for _ in range(3):
        value = ((r - z) * r - y) * r - x
        r = r - value / ((3.0 * r - 2.0 * z) * r - y + SMALLEST_DIVISOR)
    return r
