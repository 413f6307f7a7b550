"""Following a motion: limits and bounds hold in every step, and jitter adds no noise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.maths.motion.limiter import JointMotion, Limiter, Limits
from katana450.maths.motion.stream import Stream, braked, pursued

TICK = 0.01

LIMITS = Limits(
    lower=np.array((-3.0, -0.5, -2.0)),
    upper=np.array((3.0, 0.5, 2.0)),
    speed=np.array((2.2, 1.2, 0.5)),
    acceleration=np.array((2.5, 1.3, 4.0)),
    jerk=np.array((25.0, 13.0, 15.0)),
)


def test_braked_agrees_with_the_limiter() -> None:
    rng, limiter = np.random.default_rng(1), Limiter(LIMITS)
    for _ in range(300):
        q, qd, qdd = (
            rng.uniform(-limit, limit)
            for limit in (LIMITS.upper, LIMITS.speed, LIMITS.acceleration)
        )
        brake = braked(q, qd, qdd, LIMITS.acceleration, LIMITS.jerk)
        np.testing.assert_allclose(
            brake, limiter.stopping_point(JointMotion(q, qd, qdd)), rtol=0, atol=1e-9
        )


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(4))
def test_limits_hold_for_any_stream(seed: int) -> None:
    """Also test ticks of uneven length."""
    rng, limiter = np.random.default_rng(seed), Limiter(LIMITS)
    now, bounds = JointMotion.rest(np.zeros(3)), (np.full(3, -0.7), np.full(3, 0.3))
    lowest = np.maximum(bounds[0], LIMITS.lower)
    for number in range(3000):
        if number % 20 == 0:
            wanted = JointMotion(*(rng.normal(scale=scale, size=3) for scale in (0.6, 2.0, 5.0)))
        dt = TICK if number % 7 else float(rng.uniform(0.002, 0.05))
        after = pursued(limiter, now, wanted, bounds, dt)
        assert (np.abs(after.qd) <= LIMITS.speed + 1e-9).all()
        assert (np.abs(after.qdd) <= LIMITS.acceleration + 1e-9).all()
        assert (np.abs(after.qdd - now.qdd) <= LIMITS.jerk * dt + 1e-9).all()
        rest = limiter.stopping_point(after)
        assert (rest >= lowest - 1e-9).all()
        assert (rest <= bounds[1] + 1e-9).all()
        now = after


def test_a_speed_scale_that_falls_slows_down() -> None:
    limiter, now = Limiter(LIMITS), JointMotion.rest(np.zeros(3))
    wide = np.full(3, -3.0), np.full(3, 3.0)
    for number in range(200):
        wanted = JointMotion(np.full(3, 0.004 * number), np.full(3, 0.4), np.zeros(3))
        now = pursued(limiter, now, wanted, wide, TICK, 1.0 if number < 100 else 0.1)
    assert (np.abs(now.qd) <= 0.1 * LIMITS.speed + 1e-9).all()


def test_uneven_arrival_adds_no_noise_to_the_rates() -> None:
    """Differences of neighbours have errors as large as the rate here; the parabola has not."""
    rng, arrived = np.random.default_rng(4), 0.0
    stream, off = None, []
    for number in range(400):
        t = 0.02 * number
        arrived = max(arrived + 1e-4, t + float(rng.exponential(0.003)))
        q = np.array([0.4 * math.sin(math.tau * t / 3.0)])
        if stream is None:
            stream = Stream.begin(arrived, q, None)
            continue
        stream = stream.followed_by(arrived, q, None, np.array([2.5]))
        sample = stream.at(arrived + 0.005)
        if number > 50:
            off.append(abs(sample.qd[0] - 0.84 * math.cos(math.tau * (t - 0.035) / 3.0)))
    assert stream is not None
    assert stream.jitter == pytest.approx(0.003, rel=0.6)
    assert np.mean(off) < 0.06
    assert len(stream.times) < 20


def test_of_two_samples_at_one_time_the_second_counts() -> None:
    a = np.array([2.5])
    stream = Stream.begin(0.0, np.zeros(1), None).followed_by(0.02, np.array([0.01]), None, a)
    again = stream.followed_by(0.02, np.array([0.012]), None, a)
    assert (again.times == stream.times).all()
    assert again.q[:, 0].tolist() == [0.0, 0.012]
    assert (again.period, again.jitter) == (stream.period, stream.jitter)
