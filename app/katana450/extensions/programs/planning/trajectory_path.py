"""A joint path through postures at given times, a natural cubic spline, and its scaling."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.joint_path import VIA_TOLERANCE, PolynomialPath
from katana450.maths.planning.pacing import KNOTS, SampledPath
from katana450.maths.planning.path import Path
from katana450.maths.planning.polyline import PiecewisePolynomial
from katana450.maths.planning.scaling import Bounds, Scaling

MIN_INTERVAL = 1e-3
"""[s] Minimum time from one posture to the next."""

MAX_OVERSHOOT = 1e-3
"""[rad] How far the spline may pass a joint limit between two postures; setpoints are clamped."""

SLOWED_RATIO, SLOWED_TIME = 0.02, 0.02
"""Minimum time by which a plan exceeds the times of a trajectory that is named, as a ratio [1] to
them and in s."""

CHECKS_PER_PIECE = 8
"""Number of places in each piece at which the limits are checked."""


class CubicSpline(PiecewisePolynomial):
    """The natural cubic spline through the rows of ``values`` (m, n) at ``times`` (m,) [s].

    Value, rate and second derivative are continuous, and the second derivative is 0 at both ends
    (de Boor, A Practical Guide to Splines, 1978, ch. IV).
    """

    def __init__(self, times: FloatArray, values: FloatArray) -> None:
        """Fit the spline through at least two rows; ``times`` must rise."""
        h = np.diff(times)[:, None]
        slopes = np.diff(values, axis=0) / h
        bends = _second_derivatives(h, slopes)
        terms = np.zeros((len(h), 6, values.shape[1]))
        terms[:, 0] = values[:-1]
        terms[:, 1] = slopes - h * (2.0 * bends[:-1] + bends[1:]) / 6.0
        terms[:, 2] = 0.5 * bends[:-1]
        terms[:, 3] = (bends[1:] - bends[:-1]) / (6.0 * h)
        passed = times - times[0]
        super().__init__(passed[:-1].tolist(), frozen(terms), float(passed[-1]))

    def values_at(self, times: FloatArray) -> FloatArray:
        """Return the values (N, n) at ``times`` (N,) [s] after the first one."""
        coordinates = self.at(Jet.variable(np.asarray(times) / self._total))
        return np.stack(
            [np.broadcast_to(coordinate.c0, times.shape) for coordinate in coordinates], axis=1
        )


def _second_derivatives(h: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return the second derivatives (m, n) at the knots.

    The tridiagonal system is eliminated row by row, so that every machine rounds in the same order.
    """
    bends = np.zeros((len(h) + 1, slopes.shape[1]))
    diagonal = 2.0 * (h[:-1, 0] + h[1:, 0])
    right = 6.0 * np.diff(slopes, axis=0)
    for row in range(1, len(diagonal)):
        factor = h[row, 0] / diagonal[row - 1]
        diagonal[row] -= factor * h[row, 0]
        right[row] -= factor * right[row - 1]
    for row in range(len(diagonal) - 1, -1, -1):
        bends[row + 1] = (right[row] - h[row + 1, 0] * bends[row + 2]) / diagonal[row]
    return bends


@dataclass(frozen=True, eq=False)
class TrajectoryPath(PolynomialPath):
    """A joint path through postures at given times, as recorded.

    Its sigma grows evenly with the time. Raises InputError for times that do not rise, and for a
    posture beyond the joint limits.

    Attributes:
        chain: the arm with its tool.
        times: (m,) [s], rising.
        postures: (m, n) joint angles at these times [rad].
    """

    chain: Chain
    times: FloatArray
    postures: FloatArray
    _line: CubicSpline = field(init=False, repr=False)

    def __post_init__(self) -> None:
        times = finite_array(self.times, (np.size(self.times),), "The times")
        shape = (len(times), self.chain.n)
        postures = finite_array(self.postures, shape, "The postures")
        if len(times) < 2:
            raise InputError("A trajectory needs at least two postures.")
        late = np.flatnonzero(np.diff(times) < MIN_INTERVAL)
        if late.size:
            row = int(late[0])
            raise InputError(
                f"Row {row + 2} has the time {times[row + 1]:g} s. It must be at least "
                f"{1e3 * MIN_INTERVAL:g} ms later than that of the row before, {times[row]:g} s."
            )
        if float(np.ptp(postures, axis=0).max()) <= VIA_TOLERANCE:
            raise InputError("This trajectory moves nothing. Remove it, or `wait` instead.")
        line = CubicSpline(times, postures)
        object.__setattr__(self, "times", frozen(times))
        object.__setattr__(self, "_line", line)
        self._check_limits()
        # Angles with few decimals can be beyond a limit by their rounding.
        inside = np.clip(postures, self.chain.lower, self.chain.upper)
        object.__setattr__(self, "postures", frozen(inside))

    def _check_limits(self) -> None:
        inner = np.linspace(0.0, 1.0, CHECKS_PER_PIECE, endpoint=False)
        passed = self.times - self.times[0]
        t = np.append((passed[:-1, None] + np.diff(passed)[:, None] * inner).ravel(), passed[-1])
        q = self._line.values_at(t)
        beyond = np.maximum(self.chain.lower - q, q - self.chain.upper)
        if float(beyond.max()) > MAX_OVERSHOOT:
            place, axis = np.unravel_index(int(beyond.argmax()), beyond.shape)
            raise InputError(
                f"At {self.times[0] + t[place]:.2f} s axis {axis + 1} would be "
                f"{np.degrees(beyond.max()):.4g} deg beyond its limit."
            )

    def slowing(self, duration: float, speed: FloatArray) -> str:
        """Return a sentence on a plan that takes ``duration`` [s] for this; "" if that is its time.

        speed: (n,) maximum speeds of the joints [rad/s].
        """
        if duration - self.duration <= max(SLOWED_RATIO * self.duration, SLOWED_TIME):
            return ""
        t = np.linspace(0.0, self.duration, CHECKS_PER_PIECE * len(self.times))
        rates = np.abs(np.diff(self._line.values_at(t), axis=0)).max(axis=0) / t[1]
        axis = int((rates / speed).argmax())
        why = "the accelerations from rest and to rest are limited"
        if rates[axis] > speed[axis]:
            rate, limit = np.degrees((rates[axis], speed[axis]))
            why = f"axis {axis + 1} would turn at {rate:.4g} deg/s, and its limit is {limit:.4g}"
        return f"Asked to take {self.duration:.4g} s, it takes {duration:.2f} s: {why}."

    @property
    def duration(self) -> float:
        """The time from the first posture to the last [s]."""
        return float(self.times[-1] - self.times[0])

    @property
    def start(self) -> FloatArray:
        """The joint angles (n,) [rad] at the start."""
        return frozen(self.postures[0])

    @property
    def end(self) -> FloatArray:
        """The joint angles (n,) [rad] at the end."""
        return frozen(self.postures[-1])

    def time(self, sigma: float) -> float:
        """Return the time [s] at the place ``sigma``, on the clock of ``times``."""
        return float(self.times[0]) + sigma * self.duration


PIECE_TIME: Final = 0.1
"""[s] Time of each piece of the slowness."""

MAX_PIECES: Final = 1200
"""Maximum number of pieces, for a trajectory of two minutes and more."""

ROUNDS: Final = 40
"""Number of rounds that make a trajectory slower where it is too fast, and faster where it was made
too slow."""

FACTORS: Final = (4.0, 2.0, 1.4, 1.0, 0.7, 0.5)
"""Fractions [1] of the joints' largest a and j that are tried. Large ones start and pause quickly,
small ones leave more of the joints' acceleration to the trajectory."""


def recorded_scaling(path: Path, bounds: Bounds) -> Scaling:
    """Return the scaling with the times of the trajectory ``path``, or slower within ``bounds``.

    The slowness is nowhere below that of the trajectory. Where a limit would be exceeded it is
    raised, for each of several limits a and j of tau(t); the scaling with the shortest duration is
    returned.
    """
    assert isinstance(path, TrajectoryPath)
    pieces = min(max(math.ceil(path.duration / PIECE_TIME), KNOTS), MAX_PIECES)
    sampled = SampledPath.of(path, bounds, pieces)
    own = np.full(pieces + 3, path.duration)
    joints = bounds.joints
    a = float((joints.acceleration / joints.speed).min())
    j = float((joints.jerk / joints.speed).min())
    fits = (sampled.fitted(factor * a, factor * j, own, ROUNDS, floor=own) for factor in FACTORS)
    best = min(fits, key=lambda fit: fit.time)
    return Scaling(best.coefficients, best.acceleration, best.jerk)
