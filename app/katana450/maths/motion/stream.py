"""A stream of joint angles as a motion: smoothed positions, rates and accelerations at any time.

Samples arrive unevenly, so differences of neighbours say little about rates. A parabola is fitted
to the samples of a short window instead (least squares, as Savitzky and Golay do) and read a moment
before now. The more unevenly the samples arrive, the longer are the window and that moment. Angles
in rad, times in s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import JointMotion

READ_DELAY = 0.02
"""[s] How long before now an even stream is read: about one sample of a usual one."""

WINDOW = 0.12
"""[s] Of samples that count in an even stream."""

MORE_LAG, MOST_LAG = 8.0, 0.03
"""[1], [s] Lag added per second of jitter, and the most of it."""

MORE_WINDOW, MOST_WINDOW = 20.0, 0.14
"""[1], [s] Window added per second of jitter, and the most of it."""

TURN_MEMORY = 4.0
"""[s] Over which it is forgotten how hard a stream has turned."""

MARGIN, MOST_HARDNESS = 1.15, 5.0
"""[1] A stream may turn harder than it was seen to; beyond the most it makes no difference."""

DOUBT, MOST_DOUBT = 100.0, 0.4
"""[1/s], [1] About its rates, per second of jitter, and the most of it."""

MIN_SPREAD = 0.08
"""[s] Over which samples have to lie before their curvature says anything."""

MIN_SAMPLES = 4
"""Samples kept of a slow stream, whatever their age."""

SPACING = 2e-3
"""[s] Samples nearer to each other count as one, the later."""

AVERAGING = 0.1
"""[1] Weight of the newest interval in the mean interval; half of it in the mean deviation."""

RATES_WEIGHT = 0.05
"""[s] Error of a position that counts as much as one of a rate by 1 per second."""

CURVE_HORIZON = 0.04
"""[s] Beyond its newest sample, or two periods if longer, a stream is taken to curve as it did."""


@dataclass(frozen=True, eq=False)
class Stream:
    """The newest samples of a stream of n joints, and what is known of the earlier ones.

    Attributes:
        times: (k,) when each came [s], rising.
        q: (k, n) the samples [rad].
        qd: (k, n) how fast each says it changes [rad/s]; None where the sender does not say.
        lower, upper: (n,) the extremes of all samples so far [rad].
        hardness: (n,) the most that it accelerated with of late, of what the joints can, from 1.
        parabola: (3, n) coefficients of q by time from the newest sample on.
        period: mean interval between samples [s]; 0 before the second.
        jitter: mean deviation of the intervals from it [s].
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
        """The stream whose first sample ``q`` (n,), changing at ``qd``, came at ``t`` [s]."""
        rates = None if qd is None else qd[None]
        times, samples = np.array([t]), q[None]
        parabola = _fitted(times, samples, rates)
        return Stream(times, samples, rates, q, q, np.ones(len(q)), parabola)

    @property
    def t(self) -> float:
        """When the newest sample came [s]."""
        return float(self.times[-1])

    @property
    def caution(self) -> FloatArray:
        """(n,) by how much harder it may turn than the joints can brake, at least 1."""
        return self.hardness * (1.0 + min(DOUBT * self.jitter, MOST_DOUBT))

    @property
    def _lag(self) -> float:
        return (
            READ_DELAY
            if self.qd is not None
            else READ_DELAY + min(MORE_LAG * self.jitter, MOST_LAG)
        )

    @property
    def sure_until(self) -> float:
        """[s] From when on nothing is known of where it goes, unless another sample comes."""
        return self.t + self._lag + max(CURVE_HORIZON, 2.0 * self.period)

    def followed_by(
        self, t: float, q: FloatArray, qd: FloatArray | None, acceleration: FloatArray
    ) -> Stream:
        """The stream with one sample more; see ``begun``. acceleration: (n,) of the joints."""
        rates = None
        if qd is not None and self.qd is not None:
            rates = self.qd
        elif qd is not None or self.qd is not None:
            return Stream.begin(t, q, qd)
        interval = t - self.t
        if interval < SPACING:
            kept, period, jitter = slice(0, -1), self.period, self.jitter
        else:
            period = self.period + AVERAGING * (interval - self.period) if self.period else interval
            jitter = self.jitter + AVERAGING / 2.0 * (abs(interval - period) - self.jitter)
            window = WINDOW if qd is not None else WINDOW + min(MORE_WINDOW * jitter, MOST_WINDOW)
            first = int(np.searchsorted(self.times, t - window))
            kept = slice(max(min(first, len(self.times) - MIN_SAMPLES + 1), 0), None)
        times = np.append(self.times[kept], t if interval >= SPACING else self.t)
        samples = np.vstack((self.q[kept], q))
        if rates is not None and qd is not None:
            rates = np.vstack((rates[kept], qd))
        parabola = _fitted(times, samples, rates)
        fading = math.exp(-max(interval, 0.0) / TURN_MEMORY)
        hardness = np.maximum(1.0 + fading * (self.hardness - 1.0), 1.0)
        if times[-1] - times[0] >= MIN_SPREAD:
            seen = MARGIN * np.abs(2.0 * parabola[2]) / acceleration
            hardness = np.maximum(hardness, np.minimum(seen, MOST_HARDNESS))
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
        """What the stream does, as seen at ``now`` [s]: q, qd, qdd (n,) a short lag ago."""
        seen = min(now, self.sure_until)
        late, known = now - seen, seen - self._lag - self.t
        c0, c1, c2 = self.parabola
        q, qd = c0 + known * (c1 + known * c2), c1 + 2.0 * known * c2
        qdd = 2.0 * c2 if late == 0.0 else 0.0 * c2
        return JointMotion(frozen(q + late * qd), frozen(qd), frozen(qdd))


def _fitted(times: FloatArray, q: FloatArray, qd: FloatArray | None) -> FloatArray:
    """(3, n) coefficients of the parabola through samples, by time from the newest on."""
    s, values, degree = times - times[-1], q, min(3, len(times))
    rows = np.stack((s**0, s, s * s), axis=1)
    if qd is not None:
        slopes = np.stack((0.0 * s, s**0, 2.0 * s), axis=1)
        rows = np.concatenate((rows, RATES_WEIGHT * slopes))
        values = np.concatenate((values, RATES_WEIGHT * qd))
        degree = min(3, 1 + len(times))
    found = np.linalg.lstsq(rows[:, :degree], values, rcond=None)[0]
    return np.concatenate((found, np.zeros((3 - degree, q.shape[1]))))
