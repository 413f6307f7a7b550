"""A stream of joint angles as a motion, and how the arm follows it within limits and bounds.

Samples arrive unevenly, so differences of neighbours give poor rates. A parabola is fitted to the
samples of a short window instead (least squares, as by Savitzky and Golay) and read a moment before
now. The more unevenly the samples arrive, the longer are the window and that moment.

Near this motion a linear controller with rates and accelerations fed forward follows it. Far from
it, the arm approaches no faster than it can brake. Every step keeps one invariant: braking from its
end, every joint comes to rest within the bounds. An error of the controller can therefore cost
accuracy, but never exceeds the bounds. Angles in rad, times in s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450.maths.geometry.arrays import BoolArray, FloatArray, frozen
from katana450.maths.motion.limiter import MIN_SPEED_FRACTION, JointMotion, Limiter, Limits

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


POSITION_GAIN, RATE_GAIN, ACCELERATION_GAIN = 8.0, 16.0, 48.0
"""Gains [1/s] for errors of position, rate and acceleration."""

APPROACH_FRACTION = 0.6
"""Fraction [1] of the acceleration not used by the followed motion that brakes an approach."""

MIN_APPROACH_FRACTION = 0.15
"""Fraction [1] of the whole acceleration that an approach may use in any case."""

HALVINGS = 12
"""Number of halvings of the range of the jerk when the whole range does not keep the bounds."""


def stream_step(
    limiter: Limiter, now: JointMotion, stream: Stream, t: float, dt: float, fraction: float = 1.0
) -> JointMotion:
    """Return the motion ``dt`` [s] after ``now``, at the time ``t`` [s], that follows ``stream``.

    A stream inside the limits is reproduced with a short lag. For any other stream the motion stays
    inside the stream's extremes, as far as these can be predicted. ``fraction`` scales the maximum
    speed.
    """
    bounds = _intended(stream, t, limiter.limits)
    return pursued(limiter, now, stream.at(t), bounds, dt, fraction)


def pursued(
    limiter: Limiter,
    now: JointMotion,
    wanted: JointMotion,
    bounds: tuple[FloatArray, FloatArray],
    dt: float,
    fraction: float = 1.0,
) -> JointMotion:
    """Return the motion ``dt`` [s] after ``now`` that follows ``wanted``, the motion at that time.

    ``bounds`` are the minimum and maximum (n,) [rad] between which every joint must be able to come
    to rest; the limits hold if they are narrower. A joint that cannot already gets no farther
    beyond the bounds. ``fraction`` scales the maximum speed.
    """
    if dt <= 0.0:
        return now
    limits = limiter.limits
    A, J, V = limits.acceleration, limits.jerk, max(fraction, MIN_SPEED_FRACTION) * limits.speed
    qd, qdd = np.clip(wanted.qd, -V, V), np.clip(wanted.qdd, -A, A)
    halt = braked(now.q, now.qd, now.qdd, A, J)
    low = np.minimum(np.maximum(bounds[0], limits.lower), halt)
    high = np.maximum(np.minimum(bounds[1], limits.upper), halt)
    dip, peak = _rates_ahead(now.qd, now.qdd, J)
    slowest, fastest = np.minimum(-V, dip), np.maximum(V, peak)

    def stepped(jerk: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        a = now.qdd + jerk * dt
        v = now.qd + dt * (now.qdd + jerk * (dt / 2.0))
        return now.q + dt * (now.qd + dt * (now.qdd / 2.0 + jerk * (dt / 6.0))), v, a

    def beyond(jerk: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Return the joints that would go too far or too fast, downwards and upwards."""
        q, v, a = stepped(jerk)
        rest, (dip, peak) = braked(q, v, a, A, J), _rates_ahead(v, a, J)
        return (rest < low) | (dip < slowest), (rest > high) | (peak > fastest)

    minimum, maximum = np.maximum(-J, (-A - now.qdd) / dt), np.minimum(J, (A - now.qdd) / dt)
    jerk = np.clip(_target_jerk(now, wanted.q, qd, qdd, A, V, dt), minimum, maximum)
    down, up = beyond(jerk)
    if (down | up).any():
        good, bad = np.where(up, minimum, np.where(down, maximum, jerk)), jerk
        for _ in range(HALVINGS):
            middle = 0.5 * (good + bad)
            too_low, too_high = beyond(middle)
            wrong = np.where(up, too_high, too_low)
            good, bad = np.where(wrong, good, middle), np.where(wrong, middle, bad)
        jerk = good
        down, up = beyond(jerk)
    q, v, a = stepped(jerk)
    if (down | up).any():
        # A constant jerk for the whole of dt is too coarse: brake exactly.
        stop, brakes = limiter.stop(now, dt), down | up
        q, v, a = (np.where(brakes, x, y) for x, y in ((stop.q, q), (stop.qd, v), (stop.qdd, a)))
    return JointMotion(frozen(np.clip(q, limits.lower, limits.upper)), frozen(v), frozen(a))


def _rates_ahead(v: FloatArray, a: FloatArray, J: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the minimum and maximum rate (n,) [rad/s] until the acceleration can be 0."""
    return v - np.minimum(a, 0.0) ** 2 / (2.0 * J), v + np.maximum(a, 0.0) ** 2 / (2.0 * J)


def _target_jerk(
    now: JointMotion,
    q: FloatArray,
    qd: FloatArray,
    qdd: FloatArray,
    A: FloatArray,
    V: FloatArray,
    dt: float,
) -> FloatArray:
    """Return the jerk (n,) that leads to ``q``, ``qd`` and ``qdd`` in ``dt`` [s]."""
    error = q - dt * qd + 0.5 * dt * dt * qdd - now.q
    drift = qd - dt * qdd - now.qd
    left = APPROACH_FRACTION * np.maximum(A + np.sign(error) * qdd, MIN_APPROACH_FRACTION * A)
    # Linear near the target; farther away, the speed that the spare acceleration can still brake.
    near = left / POSITION_GAIN**2
    root = np.sqrt(2.0 * left * np.maximum(np.abs(error) - 0.5 * near, 0.5 * near))
    far = np.abs(error) > near
    approach = np.where(far, np.sign(error) * root, POSITION_GAIN * error)
    slope = np.where(far, left / root, POSITION_GAIN)
    rate = np.clip(qd + approach, -V, V)
    acceleration = np.clip(qdd + slope * drift + RATE_GAIN * (rate - now.qd), -A, A)
    return np.asarray((acceleration - now.qdd) / max(1.0 / ACCELERATION_GAIN, dt))


def braked(
    q: FloatArray, qd: FloatArray, qdd: FloatArray, A: FloatArray, J: FloatArray
) -> FloatArray:
    """Return the place (n,) [rad] where joints come to rest under full braking.

    The same as ``Limiter.stop``, in closed form.
    """
    sign = np.where(qd + qdd * np.abs(qdd) / (2.0 * J) < 0.0, -1.0, 1.0)
    v, a = sign * qd, sign * qdd
    # The jerk leads to the deceleration p, which stays constant where it reaches its limit.
    p = np.minimum(np.sqrt(np.maximum(J * v + 0.5 * a * a, 0.0)), A)
    t1, t3 = (a + p) / J, p / J
    v1 = v + t1 * (a - 0.5 * J * t1)
    t2 = np.maximum(v1 - 0.5 * p * t3, 0.0) / np.maximum(p, 1e-12)
    distance = t1 * (v + t1 * (0.5 * a - J * t1 / 6.0)) + t2 * (v1 - 0.5 * p * t2)
    # The last stretch, seen from its end, is one of jerk alone.
    return np.asarray(q + sign * (distance + J * t3**3 / 6.0))


def _intended(stream: Stream, t: float, limits: Limits) -> tuple[FloatArray, FloatArray]:
    """Return the bounds (n,) [rad] within which ``stream`` is expected to stay at ``t`` [s].

    They contain all its samples, and its braking distance, with the acceleration of the joints or
    the observed acceleration. A stream that turns too hard to be followed is left on the inside of
    the turn.
    """
    wanted = stream.at(min(t, stream.sure_until))
    A, J = limits.acceleration, limits.jerk
    qd, qdd = np.clip(wanted.qd, -limits.speed, limits.speed), np.clip(wanted.qdd, -A, A)
    rest = wanted.q + braked(0.0 * qd, qd, qdd, A, J) / stream.caution
    return np.minimum(stream.lower, rest), np.maximum(stream.upper, rest)
