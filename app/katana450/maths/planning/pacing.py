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

KNOTS: Final = 12
"""Number of pieces of the slowness; each join of the path adds half as many."""

SAMPLES_PER_PIECE: Final = 16
"""Number of checked places in each piece; LIMIT_FRACTION covers what lies between them."""

LIMIT_FRACTION: Final = 0.995
"""Fraction [1] of every limit that is used."""

ROUNDS: Final = 25
"""Number of rounds that make a path slower where it is too fast and faster where it is not."""

PATIENCE: Final = 8
"""Number of rounds without a gain after which no more follow."""

LEAST_GAIN: Final = 1e-4
"""Smallest fraction [1] of the time that counts as a gain."""

TRIAL_ROUNDS: Final = 6
"""The number of rounds that compare starts, and values of a and j."""

FIRST_ROUNDS: Final = 3
"""The number of rounds after which a trial must be nearly as fast as the best one."""

NEARLY: Final = 1.05
"""Factor [1] of the time for that."""

SLOWING_POWER: Final = 0.6
"""Power [1] of the excess of a place, by which it is slowed in one round."""

SPEEDING_POWER: Final = 0.1
"""Power [1] for a place that is too slow: smaller, or the rounds would oscillate."""

SMALLEST_ROOT: Final = 1e-100
"""Smallest root, which avoids 0 / 0; its square is above 0."""

SEARCH_FACTORS: Final = (1.5, 1.15)
"""Falling factors [1] by which a and j are varied, as long as it saves time."""

SMOOTHINGS: Final = (1, 3)
"""Numbers of times that the slowness is averaged with its neighbours, to find a faster one."""

SAVING: Final = 2e-3
"""Smallest fraction [1] of the time for which a smoothed slowness is taken."""


def fastest(path: Path, bounds: Bounds) -> Scaling:
    """Return the fastest scaling of `path` found that keeps to `bounds`.

    For given a and j each coefficient of the slowness is raised while a limit is exceeded near it,
    and lowered while no limit is reached. All coefficients are then made slower by the remaining
    excess. a and j are sought on a pattern that narrows. Last, the waves that this leaves in the
    slowness are smoothed. The result is near the optimum; tests show how near.
    """
    sampled = SampledPath.of(path, bounds)
    joints = bounds.joints
    a = float((joints.acceleration / joints.speed).min())
    j = float((joints.jerk / joints.speed).min())
    even = np.ones(len(sampled.first) + 3)
    # Uniform slowness, or the slowness that each place needs by itself: either may end up better.
    starts = even, sampled.near(sampled.excess(even, a, j))
    best = min(
        (sampled.fitted(a, j, start, TRIAL_ROUNDS) for start in starts), key=lambda f: f.time
    )
    for factor in SEARCH_FACTORS:
        improved, back = True, (0, 0)
        while improved:
            improved = False
            for x, y in ((1, 1), (-1, -1), (1, 0), (-1, 0), (0, 1), (0, -1)):
                if (x, y) == back:
                    # It leads to the a and j of the best one before.
                    continue
                a, j = best.acceleration * factor**x, best.jerk * factor**y
                other = sampled.fitted(a, j, best.coefficients, TRIAL_ROUNDS, NEARLY * best.time)
                if other.time < (1.0 - 1e-3) * best.time:
                    best, improved, back = other, True, (-x, -y)
    best = sampled.fitted(best.acceleration, best.jerk, best.coefficients, ROUNDS)
    best = sampled.smoothed(best)
    return Scaling(best.coefficients, best.acceleration, best.jerk)


@dataclass(frozen=True, eq=False)
class _Fitted:
    coefficients: FloatArray
    acceleration: float
    jerk: float
    time: float


@dataclass(frozen=True, eq=False)
class SampledPath:
    """A path at many places, for the search of its slowness.

    Attributes:
        pressing: first two derivatives (2, 5, N) of the joints by sigma, as fractions of the limits
            of their accelerations.
        jerking: first derivative, three times the second one, and the third one (3, 5, N), as
            fractions of the limits of their jerks.
        slopes: absolute values (2, 5, N) of the first ones of `pressing` and `jerking`.
        ratio: three times the limit of each acceleration by that of the jerk, (5, 1) [s].
        moving: largest fraction (N,) of a limit of speed, of the joints and of the tool point.
        pushing: derivatives (2, 3, N) of the tool point by sigma, as fractions of the limit of its
            acceleration; None without one.
        index: indices (4, N) of the coefficients of the slowness at each place.
        weights: their weights (3, 4, N) for the slowness and its first two derivatives.
        first: index (K,) of the first place in each piece.
    """

    pressing: FloatArray
    jerking: FloatArray
    slopes: FloatArray
    ratio: FloatArray
    moving: FloatArray
    pushing: FloatArray | None
    index: npt.NDArray[np.int64]
    weights: FloatArray
    first: npt.NDArray[np.int64]

    @staticmethod
    def of(path: Path, bounds: Bounds, pieces: int | None = None) -> SampledPath:
        """Return the samples of `path`, for a slowness of `pieces`; of KNOTS and more for None."""
        count = KNOTS + (KNOTS // 2) * len(path.joins) if pieces is None else pieces
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
        weights = np.stack([CUBIC.T @ samples for samples in (powers, slopes, bends)])
        # Joints and coordinates first: a maximum over them is then fast.
        q = joint_derivatives(path, sigma)[1:].transpose(0, 2, 1)
        p = point_derivatives(path, sigma)[1:3].transpose(0, 2, 1)
        limits = bounds.joints
        speed, acceleration, jerk = (
            (LIMIT_FRACTION * limit)[:, None]
            for limit in (limits.speed, limits.acceleration, limits.jerk)
        )
        tool = np.sqrt(np.einsum("kn,kn->n", p[0], p[0])) / (LIMIT_FRACTION * bounds.tool_speed)
        pushed = bounds.tool_acceleration
        pressing = np.ascontiguousarray(q[:2] / acceleration)
        jerking = np.ascontiguousarray(q / jerk)
        jerking[1] *= 3.0
        return SampledPath(
            pressing,
            jerking,
            np.abs([pressing[0], jerking[0]]),
            3.0 * acceleration / jerk,
            np.maximum((np.abs(q[0]) / speed).max(axis=0), tool),
            None if pushed is None else np.ascontiguousarray(p / (LIMIT_FRACTION * pushed)),
            piece + np.arange(4)[:, None],
            weights,
            np.searchsorted(piece, np.arange(count)),
        )

    def fitted(
        self,
        a: float,
        j: float,
        start: FloatArray,
        rounds: int,
        at_most: float = np.inf,
        floor: FloatArray | None = None,
    ) -> _Fitted:
        """Return the least slowness found for the bounds `a` and `j` of tau(t).

        The search begins with `start` (K + 3,), and ends early if it gains nothing more, or is not
        near the time `at_most` after its first rounds. No coefficient is below ``floor`` (K + 3,),
        with which all `rounds` are searched.
        """
        c = start if floor is not None else start * self.excess(start, a, j).max()
        best, minimum = c, np.inf
        reference, gained = np.inf, 0
        for number in range(rounds):
            checkpoint()
            excess = self.excess(c, a, j)
            maximum = max(float(excess.max()), 0.0 if floor is None else 1.0)
            # tau at the end, if the whole path is slowed until nothing is too fast.
            time = rest_to_rest(maximum * self._span(c), a, j)
            if time < minimum:
                best, minimum = maximum * c, time
            if minimum < (1.0 - LEAST_GAIN) * reference:
                reference, gained = minimum, number
            hopeless = number + 1 == FIRST_ROUNDS and minimum > at_most
            hopeless |= c is floor and maximum == 1.0
            if hopeless or (floor is None and number - gained >= PATIENCE):
                break
            near = self.near(excess)
            c = c * np.where(near > 1.0, near**SLOWING_POWER, near**SPEEDING_POWER)
            c = c if floor is None else np.maximum(c, floor)
        return _Fitted(best, a, j, minimum)

    def smoothed(self, best: _Fitted) -> _Fitted:
        """Return ``best`` with smoother slowness, as long as that saves time.

        The rounds can end in waves, in which each coefficient is near a place at its limit.
        """
        improved = True
        while improved:
            improved = False
            for passes in SMOOTHINGS:
                c = best.coefficients
                for _ in range(passes):
                    c = np.convolve(np.pad(c, 1, mode="edge"), (0.25, 0.5, 0.25), "valid")
                other = self.fitted(best.acceleration, best.jerk, c, ROUNDS, NEARLY * best.time)
                if other.time < (1.0 - SAVING) * best.time:
                    best, improved = other, True
        return best

    def near(self, excess: FloatArray) -> FloatArray:
        """Return the maximum of `excess` (N,) near each coefficient, (K + 3,).

        A coefficient affects four pieces.
        """
        padded = np.zeros(len(self.first) + 6)
        padded[3:-3] = np.maximum.reduceat(excess, self.first)
        pairs = np.maximum(padded[:-1], padded[1:])
        return np.asarray(np.maximum(pairs[:-2], pairs[2:]))

    @staticmethod
    def _span(c: FloatArray) -> float:
        total = c.sum() - (23.0 * (c[0] + c[-1]) + 12.0 * (c[1] + c[-2]) + c[2] + c[-3]) / 24.0
        return float(total) / (len(c) - 3)

    def excess(self, c: FloatArray, a: float, j: float) -> FloatArray:
        """Return the factor (N,) by which each place must be slower to keep every limit.

        All derivatives by tau are taken with the slowness 1, and the factor is divided by the
        slowness at the end, to which it is inversely proportional.
        """
        w, w1, w2 = np.einsum("dkn,kn->dn", self.weights, c[self.index])
        # Second and third derivative of sigma by tau.
        second = -w1 / w
        third = 3.0 * second * second - w2 / w
        accelerating, jerky = self.slopes
        q1, q2 = self.pressing
        bend = np.abs(q2 + second * q1)
        slowness = _quadratic(bend, 0.5 * a * accelerating).max(axis=0)
        np.maximum(slowness, self.moving, out=slowness)
        q1, q2, q3 = self.jerking
        jerk = np.abs(q3 + second * q2 + third * q1)
        cubic = _cubic(jerk, a * self.ratio * bend, j * jerky)
        np.maximum(slowness, cubic.max(axis=0), out=slowness)
        if self.pushing is not None:
            p1, p2 = self.pushing
            pushed = p2 + second * p1
            push, pull = (np.sqrt(np.einsum("kn,kn->n", rows, rows)) for rows in (pushed, p1))
            np.maximum(slowness, _quadratic(push, 0.5 * a * pull), out=slowness)
        return np.asarray(slowness / w)


def _quadratic(x: FloatArray, h: FloatArray) -> FloatArray:
    """Return the r > 0 with x / r^2 + 2 h / r = 1."""
    return np.asarray(h + np.sqrt(h * h + x))


def _cubic(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    """Return the r > 0 with x / r^3 + y / r^2 + z / r = 1.

    The value is approached from above, so that no limit is exceeded.
    """
    # r^3 - z r^2 - y r - x is convex and rises beyond its root, and the start is beyond it.
    r = np.cbrt(x) + np.sqrt(y) + z + SMALLEST_ROOT
    for _ in range(3):
        # Horner's scheme gives the value and, from its partial sums, the derivative.
        linear = r - z
        quadratic = linear * r - y
        r = r - (quadratic * r - x) / ((linear + r) * r + quadratic)
    return r
