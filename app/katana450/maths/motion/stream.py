"""A stream of joint angles as a motion: smoothed positions, rates and accelerations.

Samples arrive unevenly, so differences of neighbours give poor rates. A parabola is fitted to the
samples of a short window instead (least squares, as by Savitzky and Golay) and read a moment before
now. The more unevenly the samples arrive, the longer are the window and that moment. Angles in rad,
times in s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import JointMotion

READ_DELAY = 0.02
"""Delay [s] with which an even stream is read: about one sample of a usual stream."""

WINDOW = 0.12
"""Length [s] of the window of samples in an even stream."""

LAG_PER_JITTER, MAX_ADDED_LAG = 8.0, 0.03
"""Lag added per second of jitter [1], and its maximum [s]."""

WINDOW_PER_JITTER, MAX_ADDED_WINDOW = 20.0, 0.14
"""Window added per second of jitter [1], and its maximum [s]."""

TURN_MEMORY = 4.0
"""Time constant [s] with which the hardness of earlier turns fades."""

HARDNESS_MARGIN, MAX_HARDNESS = 1.15, 5.0
"""A stream may turn harder than observed by this factor [1]; hardness is limited to the maximum
[1].
"""

CAUTION_PER_JITTER, MAX_CAUTION = 100.0, 0.4
"""Caution about the rates per second of jitter [1/s], and its maximum [1]."""

MIN_SPREAD = 0.08
"""Minimum time span [s] of samples for a meaningful curvature."""

MIN_SAMPLES = 4
"""Number of samples kept of a slow stream, at any age."""

SPACING = 2e-3
"""Samples nearer to each other than this [s] count as one, the later."""

AVERAGING = 0.1
"""Weight [1] of the newest interval in the mean interval; half of it in the mean deviation, and
more in a slow stream, so that both are learnt in the same time."""

MAX_JITTER_WEIGHT = 0.5
"""Maximum of that weight [1]."""

RATES_WEIGHT = 0.05
"""Position error per rate error of equal weight [s]."""

CURVE_HORIZON = 0.04
"""Time [s] beyond the newest sample, or two periods if longer, for which the curvature is
extrapolated.
"""


@dataclass(frozen=True, eq=False)
class Stream:
    """The newest samples of a stream of n joints, and statistics of the earlier ones.

    Attributes:
        times: arrival time (k,) of each sample [s], rising.
        q: the samples (k, n) [rad].
        qd: the rates (k, n) sent with them [rad/s]; None if the sender gives none.
        lower, upper: the extremes (n,) of all samples so far [rad].
        hardness: maximum recent acceleration (n,) relative to that of the joints, at least 1.
        parabola: coefficients (3, n) of q by time from the newest sample on.
        period: mean interval between samples [s]; 0 before the second.
        jitter: mean deviation of the intervals from the period [s].
    """

    times: FloatArray
    q: FloatArray
    qd: FloatArray | None
    lower: FloatArray
    upper: FloatArray
    hardness: FloatArray
    parabola: FloatArray
    period: float = 0.0
    jitter: float = 0.0

    @staticmethod
    def begin(t: float, q: FloatArray, qd: FloatArray | None) -> Stream:
        """Return the stream whose first sample ``q`` (n,), rates ``qd``, arrived at ``t`` [s]."""
        rates = None if qd is None else qd[None]
        times, samples = np.array([t]), q[None]
        parabola = _fitted(times, samples, rates)
        return Stream(times, samples, rates, q, q, np.ones(len(q)), parabola)

    @property
    def t(self) -> float:
        """The arrival time of the newest sample [s]."""
        return float(self.times[-1])

    @property
    def caution(self) -> FloatArray:
        """The factor (n,), at least 1, by which it may turn harder than the joints can brake."""
        return self.hardness * (1.0 + min(CAUTION_PER_JITTER * self.jitter, MAX_CAUTION))

    @property
    def _lag(self) -> float:
        # A slow stream is read between its samples: beyond the newest one it would be guessed.
        slow = max(self.period - READ_DELAY, 0.0)
        longest = slow if self.qd is not None else max(slow, MAX_ADDED_LAG)
        return READ_DELAY + slow + min(LAG_PER_JITTER * self.jitter, longest)

    @property
    def sure_until(self) -> float:
        """The time [s] after which the stream is unknown unless another sample arrives."""
        return self.t + self._lag + max(CURVE_HORIZON, self.period)

    def followed_by(
        self, t: float, q: FloatArray, qd: FloatArray | None, acceleration: FloatArray
    ) -> Stream:
        """Return the stream with one more sample; the arguments are those of ``begin``.

        ``acceleration`` (n,) is the limit of the joints.
        """
        rates = None
        if qd is not None and self.qd is not None:
            rates = self.qd
        elif qd is not None or self.qd is not None:
            return Stream.begin(t, q, qd)
        interval = t - self.t
        if interval < SPACING:
            newest, period, jitter = slice(0, -1), self.period, self.jitter
        else:
            period = self.period + AVERAGING * (interval - self.period) if self.period else interval
            weight = min(AVERAGING / 2.0 * max(period / READ_DELAY, 1.0), MAX_JITTER_WEIGHT)
            jitter = self.jitter + weight * (abs(interval - period) - self.jitter)
            window = (
                WINDOW
                if qd is not None
                else WINDOW + min(WINDOW_PER_JITTER * jitter, MAX_ADDED_WINDOW)
            )
            first = int(np.searchsorted(self.times, t - window))
            newest = slice(max(min(first, len(self.times) - MIN_SAMPLES + 1), 0), None)
        times = np.append(self.times[newest], t if interval >= SPACING else self.t)
        samples = np.vstack((self.q[newest], q))
        if rates is not None and qd is not None:
            rates = np.vstack((rates[newest], qd))
        parabola = _fitted(times, samples, rates)
        fading = math.exp(-max(interval, 0.0) / TURN_MEMORY)
        hardness = np.maximum(1.0 + fading * (self.hardness - 1.0), 1.0)
        if times[-1] - times[0] >= MIN_SPREAD:
            measured_hardness = HARDNESS_MARGIN * np.abs(2.0 * parabola[2]) / acceleration
            hardness = np.maximum(hardness, np.minimum(measured_hardness, MAX_HARDNESS))
        return Stream(
            times,
            samples,
            rates,
            np.minimum(self.lower, q),
            np.maximum(self.upper, q),
            hardness,
            parabola,
            period,
            jitter,
        )

    def at(self, now: float) -> JointMotion:
        """Return the motion of the stream at ``now`` [s]: q, qd, qdd (n,) a short lag ago."""
        instant = min(now, self.sure_until)
        late, known = now - instant, instant - self._lag - self.t
        c0, c1, c2 = self.parabola
        q, qd = c0 + known * (c1 + known * c2), c1 + 2.0 * known * c2
        qdd = 2.0 * c2 if late == 0.0 else 0.0 * c2
        return JointMotion(frozen(q + late * qd), frozen(qd), frozen(qdd))


def _fitted(times: FloatArray, q: FloatArray, qd: FloatArray | None) -> FloatArray:
    """Return the parabola's coefficients (3, n) through samples, by time from the newest on."""
    s, values, degree = times - times[-1], q, min(3, len(times))
    rows = np.stack((s**0, s, s * s), axis=1)
    if qd is not None:
        slopes = np.stack((0.0 * s, s**0, 2.0 * s), axis=1)
        rows = np.concatenate((rows, RATES_WEIGHT * slopes))
        values = np.concatenate((values, RATES_WEIGHT * qd))
        degree = min(3, 1 + len(times))
    coefficients = np.linalg.lstsq(rows[:, :degree], values, rcond=None)[0]
    return np.concatenate((coefficients, np.zeros((3 - degree, q.shape[1]))))
