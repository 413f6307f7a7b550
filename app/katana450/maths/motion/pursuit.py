"""Following a motion within limits of speed, acceleration and jerk, and within bounds.

Near the followed motion this is a linear controller with rates and accelerations fed forward. Far
from it, it approaches no faster than it can brake. Every step keeps one invariant: braking from its
end, every joint comes to rest within the bounds. An error of the controller can therefore cost
accuracy, but never exceeds the bounds.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.motion.limiter import MIN_SPEED_FRACTION, JointMotion, Limiter, Limits
from katana450.maths.motion.stream import Stream

BoolArray = npt.NDArray[np.bool_]

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
