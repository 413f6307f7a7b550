"""Setpoints keep the limits of position, speed, acceleration and jerk for any goals at any time."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.motion.limiter import JointMotion, Limiter, Limits
from katana450.maths.motion.stream import Stream, braked, pursued
from tests.conftest import LONG

DT = 0.01
LIMITS = Limits(
    lower=np.array([-3.0, -2.0, -2.0, -1.9, -2.8]),
    upper=np.array([2.8, 0.13, 2.2, 1.8, 2.9]),
    speed=np.array([2.2, 1.2, 2.4, 2.2, 2.9]),
    acceleration=np.array([2.4, 1.3, 2.6, 2.4, 3.1]),
    jerk=np.array([24.0, 13.0, 26.0, 24.0, 31.0]),
)


@pytest.fixture
def limiter() -> Limiter:
    return Limiter(LIMITS)


def inside(rng: np.random.Generator) -> FloatArray:
    return rng.uniform(LIMITS.lower, LIMITS.upper)


def check(before: JointMotion, after: JointMotion, dt: float = DT) -> None:
    """Check that one step keeps every limit and is continuous."""
    assert (after.q >= LIMITS.lower - 1e-9).all()
    assert (after.q <= LIMITS.upper + 1e-9).all()
    assert (np.abs(after.qd) <= LIMITS.speed * (1 + 1e-9)).all()
    assert (np.abs(after.qdd) <= LIMITS.acceleration * (1 + 1e-9)).all()
    assert (np.abs(after.qdd - before.qdd) <= LIMITS.jerk * dt * (1 + 1e-6) + 1e-8).all()
    assert (np.abs(after.qd - before.qd) <= LIMITS.acceleration * dt * (1 + 1e-6) + 1e-8).all()
    assert (np.abs(after.q - before.q) <= LIMITS.speed * dt * (1 + 1e-6) + 1e-9).all()


def test_a_move_ends_at_rest_exactly_at_its_goal(limiter: Limiter) -> None:
    rng = np.random.default_rng(1)
    for _ in range(40 if LONG else 15):
        start, goal = inside(rng), inside(rng)
        motion = JointMotion.rest(start)
        for _ in range(2000):
            after = limiter.towards(motion, goal, DT)
            check(motion, after)
            # From rest, on the straight line between the two.
            line = goal - start
            fraction = (after.q - start) @ line / (line @ line)
            assert np.abs(after.q - start - fraction * line).max() < 1e-6
            motion = after
            if motion.at_rest:
                break
        assert np.array_equal(motion.q, goal)


def test_goals_that_change_at_any_tick_keep_the_limits(limiter: Limiter) -> None:
    rng = np.random.default_rng(2)
    motion, goal, fraction = JointMotion.rest(inside(rng)), inside(rng), 1.0
    for tick in range(8000 if LONG else 3000):
        if rng.random() < 0.15:
            # Limits are chosen as goals more often than chance would choose them.
            goal = inside(rng)
            ends = rng.random(5) < 0.3
            goal[ends] = np.where(rng.random(5) < 0.5, LIMITS.lower, LIMITS.upper)[ends]
        if rng.random() < 0.02:
            fraction = float(rng.uniform(0.05, 1.0))
        stopping = tick % 400 > 380
        after = (
            limiter.stop(motion, DT) if stopping else limiter.towards(motion, goal, DT, fraction)
        )
        check(motion, after)
        motion = after


def test_motion_that_is_too_fast_for_a_limit_stops_before_it_goes_on(limiter: Limiter) -> None:
    q, qd = np.zeros(5), np.zeros(5)
    q[0], qd[0] = LIMITS.upper[0] - 0.01, LIMITS.speed[0]
    motion = JointMotion(q, qd, np.zeros(5))
    after, stopped = limiter.towards(motion, LIMITS.lower, DT), limiter.stop(motion, DT)
    np.testing.assert_array_equal(after.q, stopped.q)
    np.testing.assert_array_equal(after.qd, stopped.qd)


def test_stop_is_the_fastest_within_limits(limiter: Limiter) -> None:
    rng = np.random.default_rng(3)
    for _ in range(30):
        motion, goal = JointMotion.rest(inside(rng)), inside(rng)
        for _ in range(int(rng.integers(5, 120))):
            motion = limiter.towards(motion, goal, DT)
        stopping_point, time = limiter.stopping_point(motion), limiter.stopping_time(motion)
        # No jerk-limited stop is faster than one at full braking, or slower than full braking after
        # the jerk that it takes to get there and back.
        bang = (np.abs(motion.qd) / LIMITS.acceleration).max()
        assert bang <= time + 1e-9
        assert time <= bang + 3.0 * (LIMITS.acceleration / LIMITS.jerk).max()
        ticks = 0
        while not motion.at_rest:
            after = limiter.stop(motion, DT)
            check(motion, after)
            motion, ticks = after, ticks + 1
        assert ticks <= np.ceil(time / DT) + 1
        assert np.abs(motion.q - stopping_point).max() < 1e-6


def test_brake_is_as_near_to_its_chords_as_its_bend_says(limiter: Limiter) -> None:
    rng = np.random.default_rng(5)
    largest = 0.0
    for _ in range(30):
        motion, goal = JointMotion.rest(inside(rng)), inside(rng)
        for _ in range(int(rng.integers(5, 120))):
            goal = inside(rng) if rng.random() < 0.1 else goal
            motion = limiter.towards(motion, goal, DT)
        lower, upper = limiter.stopping_range(motion)
        pieces = limiter.stopping_path(motion, 0.1, lambda change: float(np.abs(change).sum()))
        place = motion.q
        for piece in pieces:
            a, b, bend = piece.place(0.0), piece.place(1.0), piece.bend(0.0, 1.0)
            np.testing.assert_allclose(a, place, atol=1e-12)
            for part in np.linspace(0.0, 1.0, 21).tolist():
                q = piece.place(part)
                aside = np.abs(q - a - part * (b - a))
                assert (aside <= bend / 8.0 + 1e-12).all()
                assert (q >= lower - 1e-12).all()
                assert (q <= upper + 1e-12).all()
                largest = max(largest, float(aside.max()))
            place = b
        np.testing.assert_allclose(place, limiter.stopping_point(motion), atol=1e-12)
    assert largest > 1e-4


def test_fraction_of_the_speed_is_kept(limiter: Limiter) -> None:
    motion, goal = JointMotion.rest(np.zeros(5)), LIMITS.lower
    fastest = np.zeros(5)
    for _ in range(3000):
        motion = limiter.towards(motion, goal, DT, 0.25)
        fastest = np.maximum(fastest, np.abs(motion.qd))
    assert (fastest <= 0.25 * LIMITS.speed * (1 + 1e-9)).all()
    assert (fastest / LIMITS.speed).max() > 0.249
    assert np.array_equal(motion.q, goal)


def test_rates_are_reached_and_brake_before_a_limit(limiter: Limiter) -> None:
    rng = np.random.default_rng(4)
    motion = JointMotion.rest(inside(rng))
    for _ in range(60 if LONG else 25):
        qd = rng.uniform(-1.5, 1.5, 5) * LIMITS.speed
        for _ in range(int(rng.integers(1, 150))):
            after = limiter.at_rate(motion, qd, DT)
            check(motion, after)
            motion = after
    motion = JointMotion.rest(np.zeros(5))
    slow = 0.1 * LIMITS.speed * (1, -1, 1, 1, -1)
    for _ in range(100):
        motion = limiter.at_rate(motion, slow, DT)
    assert np.allclose(motion.qd, slow)


def test_jog_stops_close_before_the_limit(limiter: Limiter) -> None:
    rng = np.random.default_rng(8)
    for room in np.geomspace(1e-4, 3.0, 60):
        ends = np.where(rng.random(5) < 0.5, LIMITS.lower, LIMITS.upper)
        q = ends + np.where(ends == LIMITS.lower, room, -room)
        q = np.clip(q, LIMITS.lower + 1e-4, LIMITS.upper - 1e-4)
        for rates, end in zip(limiter.stoppable(q), (LIMITS.lower, LIMITS.upper), strict=True):
            ratio = (limiter.stopping_point(JointMotion(q, rates, np.zeros(5))) - q) / (end - q)
            assert (ratio > 0.5).all()
            assert (ratio < 1.0).all()


def test_nothing_moves_without_time_or_reason(limiter: Limiter) -> None:
    motion = JointMotion.rest(np.zeros(5))
    assert limiter.towards(motion, LIMITS.upper, 0.0) is motion
    assert limiter.towards(motion, np.zeros(5), DT) is motion
    assert limiter.stop(motion, DT) is motion
    assert limiter.stopping_time(motion) == 0.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("speed", [0.0] * 5),
        ("acceleration", [-1.0] * 5),
        ("jerk", [np.nan] * 5),
        ("upper", [-9.0] * 5),
        ("lower", [0.0] * 4),
    ],
)
def test_invalid_limits_are_refused(name: str, value: list[float]) -> None:
    values = {key: getattr(LIMITS, key) for key in ("lower", "upper", "speed", "acceleration")}
    with pytest.raises(InputError):
        Limits(**{**values, "jerk": LIMITS.jerk, name: np.array(value)})


TICK = 0.01

PURSUIT_LIMITS = Limits(
    lower=np.array((-3.0, -0.5, -2.0)),
    upper=np.array((3.0, 0.5, 2.0)),
    speed=np.array((2.2, 1.2, 0.5)),
    acceleration=np.array((2.5, 1.3, 4.0)),
    jerk=np.array((25.0, 13.0, 15.0)),
)


def test_braked_agrees_with_the_limiter() -> None:
    rng, limiter = np.random.default_rng(1), Limiter(PURSUIT_LIMITS)
    for _ in range(300):
        q, qd, qdd = (
            rng.uniform(-limit, limit)
            for limit in (PURSUIT_LIMITS.upper, PURSUIT_LIMITS.speed, PURSUIT_LIMITS.acceleration)
        )
        brake = braked(q, qd, qdd, PURSUIT_LIMITS.acceleration, PURSUIT_LIMITS.jerk)
        np.testing.assert_allclose(
            brake, limiter.stopping_point(JointMotion(q, qd, qdd)), rtol=0, atol=1e-9
        )


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(4))
def test_limits_hold_for_any_stream(seed: int) -> None:
    """Also test ticks of uneven length."""
    rng, limiter = np.random.default_rng(seed), Limiter(PURSUIT_LIMITS)
    now, bounds = JointMotion.rest(np.zeros(3)), (np.full(3, -0.7), np.full(3, 0.3))
    lowest = np.maximum(bounds[0], PURSUIT_LIMITS.lower)
    for number in range(3000 if LONG else 1000):
        if number % 20 == 0:
            wanted = JointMotion(*(rng.normal(scale=scale, size=3) for scale in (0.6, 2.0, 5.0)))
        dt = TICK if number % 7 else float(rng.uniform(0.002, 0.05))
        after = pursued(limiter, now, wanted, bounds, dt)
        assert (np.abs(after.qd) <= PURSUIT_LIMITS.speed + 1e-9).all()
        assert (np.abs(after.qdd) <= PURSUIT_LIMITS.acceleration + 1e-9).all()
        assert (np.abs(after.qdd - now.qdd) <= PURSUIT_LIMITS.jerk * dt + 1e-9).all()
        rest = limiter.stopping_point(after)
        assert (rest >= lowest - 1e-9).all()
        assert (rest <= bounds[1] + 1e-9).all()
        now = after


def test_a_speed_scale_that_falls_slows_down() -> None:
    limiter, now = Limiter(PURSUIT_LIMITS), JointMotion.rest(np.zeros(3))
    wide = np.full(3, -3.0), np.full(3, 3.0)
    for number in range(200):
        wanted = JointMotion(np.full(3, 0.004 * number), np.full(3, 0.4), np.zeros(3))
        now = pursued(limiter, now, wanted, wide, TICK, 1.0 if number < 100 else 0.1)
    assert (np.abs(now.qd) <= 0.1 * PURSUIT_LIMITS.speed + 1e-9).all()


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
