"""The time scaling of a path: as fast as the limits allow, and slower on request.

Two steps lead from time to the path. sigma = g(tau) is fixed when a path is planned. tau(t) is
chosen while the path runs, with |tau'| <= 1, |tau''| <= a and |tau'''| <= j. With subscripts for
derivatives by tau the joints then have

    qd = q_tau tau',   qdd = q_tautau tau'^2 + q_tau tau'',
    qddd = q_tautautau tau'^3 + 3 q_tautau tau' tau'' + q_tau tau'''

so that speed, acceleration and jerk keep their limits v, A, J for every such tau(t) if everywhere

    |q_tau| <= v,   |q_tautau| + |q_tau| a <= A,   |q_tautautau| + 3 |q_tautau| a + |q_tau| j <= J.

To pause, reverse or slow down therefore changes tau alone and keeps the shape of the path. g is
given by its slowness w = d tau / d sigma, a uniform cubic B-spline with coefficients above 0.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.motion.limiter import Limits

CUBIC: Final = (
    np.array(
        [[1.0, 4.0, 1.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [3.0, -6.0, 3.0, 0.0], [-1.0, 3.0, -3.0, 1.0]]
    )
    / 6.0
)
"""The map from four coefficients of a uniform cubic B-spline to the polynomial between two knots.
"""


@dataclass(frozen=True)
class Bounds:
    """The limits of a motion along a path.

    Raises InputError unless the tool's limits are numbers above 0.

    Attributes:
        joints: limits of speed, acceleration and jerk.
        tool_speed: maximum speed of the tool point [m/s].
        tool_acceleration: maximum acceleration of the tool point [m/s^2], as for a full cup; None
            for no limit.
    """

    joints: Limits
    tool_speed: float
    tool_acceleration: float | None = None

    def __post_init__(self) -> None:
        for name, value in (("speed", self.tool_speed), ("acceleration", self.tool_acceleration)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError(f"The tool's {name} must be a number above 0, not {value!r}.")


@dataclass(frozen=True)
class PathRates:
    """Sigma at some tau, and its first three derivatives by tau."""

    sigma: float
    first: float
    second: float
    third: float


@dataclass(frozen=True, eq=False)
class Scaling:
    """The map sigma = g(tau) for tau from 0 to `span` [s], and the limits of tau(t).

    Attributes:
        coefficients: coefficients (K + 3,) [s] of the slowness over K equal pieces of sigma.
        acceleration, jerk: a and j, the maximum of tau'' [1/s] and tau''' [1/s^2].
    """

    coefficients: FloatArray
    acceleration: float
    jerk: float

    def __post_init__(self) -> None:
        c = finite_array(self.coefficients, (np.size(self.coefficients),), "The coefficients")
        if len(c) < 4 or not (c > 0.0).all() or not min(self.acceleration, self.jerk) > 0.0:
            raise InputError(
                "A scaling needs at least four coefficients, and all its numbers above 0."
            )
        object.__setattr__(self, "coefficients", frozen(c))

    @property
    def span(self) -> float:
        """The tau at the end of the path [s]."""
        return self._starts[-1]

    @property
    def duration(self) -> float:
        """The duration [s] from rest to rest at full speed."""
        return self.duration_at(1.0)

    def duration_at(self, fraction: float) -> float:
        """Return the duration [s] from rest to rest at ``fraction`` of full speed.

        It limits tau' alone: a short path, whose ramps do not reach the limit, takes no longer.
        """
        distance, a, j = (x / fraction for x in (self.span, self.acceleration, self.jerk))
        return rest_to_rest(distance, a, j)

    def motion_after(self, t: float) -> tuple[float, float, float]:
        """Return tau [s], tau' [1] and tau'' [1/s] at ``t`` [s] after the start at full speed."""
        return motion_after(t, self.span, self.acceleration, self.jerk)

    @cached_property
    def _pieces(self) -> list[list[float]]:
        """The slowness of each piece as a polynomial of the fraction of that piece."""
        c = self.coefficients
        fours = np.stack([c[k : len(c) - 3 + k] for k in range(4)], axis=1)
        pieces: list[list[float]] = (fours @ CUBIC.T).tolist()
        return pieces

    @cached_property
    def _starts(self) -> list[float]:
        """The tau at which each piece begins, and that at the end."""
        fractions = np.array([1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0]) / len(self._pieces)
        passed = np.cumsum(np.array(self._pieces) @ fractions)
        return [0.0, *passed.tolist()]

    def pace(self, tau: float) -> PathRates:
        """Return sigma and its derivatives at `tau`, from 0 to `span`."""
        starts, count = self._starts, len(self._pieces)
        piece = min(max(bisect_right(starts, tau) - 1, 0), count - 1)
        a, b, c, d = self._pieces[piece]
        passed = (tau - starts[piece]) * count
        # tau grows with the fraction and is nearly straight over a piece: Newton's rule converges
        # fast.
        fraction = passed / ((starts[piece + 1] - starts[piece]) * count)
        for _ in range(8):
            distance = fraction * (
                a + fraction * (b / 2.0 + fraction * (c / 3.0 + fraction * d / 4.0))
            )
            step = (passed - distance) / (a + fraction * (b + fraction * (c + fraction * d)))
            fraction = min(max(fraction + step, 0.0), 1.0)
            if abs(step) < 1e-15:
                break
        w = a + fraction * (b + fraction * (c + fraction * d))
        w1 = count * (b + fraction * (2.0 * c + fraction * 3.0 * d))
        w2 = count * count * (2.0 * c + fraction * 6.0 * d)
        return PathRates((piece + fraction) / count, *_inverted(w, w1, w2))

    def tau(self, sigma: float) -> float:
        """Return tau [s] at the place `sigma` of the path, from 0 to 1."""
        count = len(self._pieces)
        piece = min(max(int(sigma * count), 0), count - 1)
        a, b, c, d = self._pieces[piece]
        fraction = sigma * count - piece
        distance = fraction * (a + fraction * (b / 2.0 + fraction * (c / 3.0 + fraction * d / 4.0)))
        return self._starts[piece] + distance / count


def rest_to_rest(distance: float, a: float, j: float) -> float:
    """Return the time [s] for `distance` from rest to rest at speed 1, acceleration `a`, jerk `j`.

    Source: Biagiotti and Melchiorri, Trajectory Planning (2008), ch. 3.4.
    """
    if a * a >= j:
        # Full speed is reached without full acceleration.
        up = 2.0 / math.sqrt(j)
        return distance + up if distance >= up else 4.0 * (distance / (2.0 * j)) ** (1.0 / 3.0)
    up = 1.0 / a + a / j
    if distance >= up:
        return distance + up
    if distance >= 2.0 * a**3 / j**2:
        return a / j + math.sqrt((a / j) ** 2 + 4.0 * distance / a)
    return float(4.0 * (distance / (2.0 * j)) ** (1.0 / 3.0))


def motion_after(t: float, distance: float, a: float, j: float) -> tuple[float, float, float]:
    """Return place, speed and acceleration of `rest_to_rest` at ``t`` [s] after its start."""
    total = rest_to_rest(distance, a, j)
    t = min(max(t, 0.0), total)
    if t > 0.5 * total:
        left, speed, acceleration = motion_after(total - t, distance, a, j)
        return distance - left, speed, -acceleration
    # The jerk lasts for `ramp`, and the speed grows until `up`.
    ramp = min(a / j, 1.0 / math.sqrt(j), math.cbrt(distance / (2.0 * j)))
    up = min(1.0 / (j * ramp) + ramp, 0.5 * total)
    if t <= ramp:
        return j * t**3 / 6.0, 0.5 * j * t**2, j * t
    if t <= up - ramp:
        since = t - ramp
        place = j * ramp * (ramp**2 / 6.0 + 0.5 * ramp * since + 0.5 * since**2)
        return place, j * ramp * (0.5 * ramp + since), j * ramp
    speed = j * ramp * (up - ramp)
    left = max(up - t, 0.0)
    place = speed * (t - 0.5 * up) + j * left**3 / 6.0
    return place, speed - 0.5 * j * left**2, j * left


def _inverted(w: float, w1: float, w2: float) -> tuple[float, float, float]:
    """Return sigma_tau, sigma_tautau, sigma_tautautau from the slowness and its derivatives.

    The derivatives w1, w2 are by sigma.
    """
    first = 1.0 / w
    cube = first**3
    return first, -w1 * cube, (3.0 * w1 * w1 * first - w2) * cube * first
