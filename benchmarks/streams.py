"""Accuracy with which streams of joint angles are followed, beside three peers.

    python -m benchmarks.streams

One joint of the arm (axis 1) and its limits. Peers: ruckig, which plans a path to the newest
sample, extrapolated at its rate, in each tick; a first-order smoothing filter, like that in front
of many servo controllers, followed by limits of speed, acceleration and jerk; and the Butterworth
filter of MoveIt Servo with its default coefficient, which bounds the speed alone. Each gets the
same samples at the same times. The columns of each stream are:

* used: fraction of the acceleration limit that the stream itself needs (above 1 it cannot be
  followed).
* beyond: maximum distance of the setpoint beyond the extremes of the stream, of its amplitude.
* amplitude: maximum distance of the setpoint from the middle after settling, of the stream's; and
  the lag [ms] that explains the setpoint best, with the remaining error.
* ratio: the remaining error of each peer, divided by ours.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Trajectory

from katana450.arm.control.commands.joint_commands import JOG_TIME
from katana450.arm.robot.loader import load
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.motion.limiter import JointMotion, Limiter, Limits
from katana450.maths.motion.stream import Stream, stream_step

TICK = 0.01

TRANSPORT = 0.004
"""[s] Minimum delay from the sender to the arm."""

SMOOTHING = 0.06
"""[s] Time constant of the smoothing peer."""

SERVO_COEFFICIENT = 1.5
"""[1] Default of ``low_pass_filter_coeff`` in the Butterworth filter of MoveIt Servo."""

Signal = Callable[[float], float]

Follower = Callable[[Limiter, "Feed"], FloatArray]


@dataclass(frozen=True)
class Case:
    """A stream: its value [rad] at any time.

    Attributes:
        name: name in the table.
        signal: the value [rad] at a time [s].
        settled: time from which amplitude and lag are measured [s].
        duration: [s].
        hz: samples per second.
        rates: whether samples include their rate.
        jitter: mean delay of a sample beyond TRANSPORT [s].
    """

    name: str
    signal: Signal
    settled: float
    duration: float
    hz: float = 50.0
    rates: bool = False
    jitter: float = 0.0

    def rate(self, t: float) -> float:
        """Return the rate of the signal [rad/s]."""
        return (self.signal(t + 1e-5) - self.signal(t - 1e-5)) / 2e-5

    @property
    def used(self) -> float:
        """[rad/s^2] Maximum acceleration of the signal itself, away from its corners."""
        t, h = np.linspace(0.01, self.duration - 0.01, 4000), 1e-3
        q = np.array([[self.signal(x + d) for x in t] for d in (-h, 0.0, h)])
        return float(np.quantile(np.abs(q[0] - 2.0 * q[1] + q[2]) / h**2, 0.995))


@dataclass(frozen=True)
class Feed:
    """The input of a follower by tick: times of arrival, samples, and rates or None."""

    ticks: list[list[tuple[float, float, float | None]]]

    @staticmethod
    def of(case: Case, seed: int = 450) -> Feed:
        """Return the samples of ``case`` by the tick that uses them."""
        rng = np.random.default_rng(seed)
        sent = np.arange(0.0, case.duration, 1.0 / case.hz)
        late = rng.exponential(case.jitter, len(sent)) if case.jitter else np.zeros(len(sent))
        arrived = np.maximum.accumulate(sent + TRANSPORT + late)
        ticks: list[list[tuple[float, float, float | None]]] = [
            [] for _ in range(round(case.duration / TICK) + 1)
        ]
        for s, t in zip(sent.tolist(), arrived.tolist(), strict=True):
            tick = math.ceil(t / TICK)
            if tick < len(ticks):
                ticks[tick].append((t, case.signal(s), case.rate(s) if case.rates else None))
        return Feed(ticks)


def ours(limiter: Limiter, feed: Feed) -> FloatArray:
    """Follow with the app's own follower; return (ticks, 3) q, qd, qdd."""
    now, stream, found = JointMotion.rest(np.zeros(1)), None, []
    for number, samples in enumerate(feed.ticks):
        for t, q, qd in samples:
            sample = np.array([q]), None if qd is None else np.array([qd])
            stream = (
                Stream.begin(t, *sample)
                if stream is None
                else stream.followed_by(t, *sample, limiter.limits.acceleration)
            )
        if stream is not None and number * TICK - stream.t >= JOG_TIME:
            now = limiter.towards(now, stream.q[-1], TICK)
        elif stream is not None:
            now = stream_step(limiter, now, stream, number * TICK, TICK)
        found.append((now.q[0], now.qd[0], now.qdd[0]))
    return np.array(found)


def ruckigs(limiter: Limiter, feed: Feed) -> FloatArray:
    """Follow the newest sample with ruckig; the rate is given or by difference."""
    planner, plan, trajectory = Ruckig(1), InputParameter(1), Trajectory(1)
    limits = limiter.limits
    plan.max_velocity, plan.max_acceleration, plan.max_jerk = (
        each.tolist() for each in (limits.speed, limits.acceleration, limits.jerk)
    )
    now, last, found = (0.0, 0.0, 0.0), None, []
    for number, samples in enumerate(feed.ticks):
        for t, q, qd in samples:
            seen = 0.0 if last is None or t <= last[0] else (q - last[1]) / (t - last[0])
            last = t, q, seen if qd is None else qd
        if last is not None:
            t, q, rate = last
            maximum = 0.99 * float(limits.speed[0])
            rate = min(max(rate, -maximum), maximum)
            plan.current_position, plan.current_velocity, plan.current_acceleration = (
                [each] for each in now
            )
            plan.target_position = [q + (number * TICK - t) * rate]
            plan.target_velocity = [rate]
            if planner.calculate(plan, trajectory) in (Result.Working, Result.Finished):
                (x,), (v,), (a,) = trajectory.at_time(TICK)
                now = float(x), float(v), float(a)
        found.append(now)
    return np.array(found)


def smoothed(limiter: Limiter, feed: Feed) -> FloatArray:
    """Follow with a first-order filter of the samples and the limits behind it."""
    now, goal, low, found = JointMotion.rest(np.zeros(1)), None, np.zeros(1), []
    for samples in feed.ticks:
        for _, q, _ in samples:
            goal = np.array([q])
        if goal is not None:
            low = low + (1.0 - math.exp(-TICK / SMOOTHING)) * (goal - low)
            now = limiter.towards(now, low, TICK)
        found.append((now.q[0], now.qd[0], now.qdd[0]))
    return np.array(found)


def servo_filtered(limiter: Limiter, feed: Feed) -> FloatArray:
    """Follow with the filter that MoveIt Servo ships by default, and the speed limit behind it.

    It is a Butterworth low-pass of first order in the form of a bilinear transform. Like Servo, it
    bounds the speed and neither acceleration nor jerk.
    """
    scale, feedback = 1.0 / (1.0 + SERVO_COEFFICIENT), 1.0 - SERVO_COEFFICIENT
    top = float(limiter.limits.speed[0]) * TICK
    goal, before, low, q, qd, found = None, 0.0, 0.0, 0.0, 0.0, []
    for samples in feed.ticks:
        for _, sample, _ in samples:
            goal = sample
        if goal is not None:
            low, before = scale * (before + goal - feedback * low), goal
        step = min(max(low - q, -top), top)
        q, was, qd = q + step, qd, step / TICK
        found.append((q, qd, (qd - was) / TICK))
    return np.array(found)


@dataclass(frozen=True)
class Outcome:
    """The quality of following a stream, as described at the top of this file.

    Attributes:
        beyond: fraction of the amplitude.
        peak: fraction of the amplitude.
        lag: [s].
        left: remaining error [rad].
    """

    beyond: float
    peak: float
    lag: float
    left: float


def judged(case: Case, motion: FloatArray) -> Outcome:
    """Return the quality of ``motion`` (ticks, 3) for the stream ``case``."""
    t = TICK * np.arange(len(motion))
    q = motion[:, 0]
    target = np.array([case.signal(x) for x in np.arange(0.0, case.duration, TICK / 4)])
    beyond = max(
        float(q.max() - max(target.max(), 0.0)), float(min(target.min(), 0.0) - q.min()), 0.0
    )
    late = t > case.settled
    best, left = 0.0, math.inf
    for lag in np.arange(-0.02, 0.4, 0.002).tolist():
        off = q[late] - np.array([case.signal(x - lag) for x in t[late]])
        if np.abs(off).max() < left:
            best, left = lag, float(np.abs(off).max())
    settled = target[np.arange(0.0, case.duration, TICK / 4) > case.settled]
    middle, half = 0.5 * (settled.max() + settled.min()), 0.5 * float(np.ptp(settled))
    return Outcome(beyond / half, float(np.abs(q[late] - middle).max()) / half, best, left)


def sine(amplitude: float, period: float) -> Signal:
    """Return a sine that starts in the middle."""
    return lambda t: amplitude * math.sin(math.tau * t / period)


def chirp(amplitude: float, first: float, last: float, duration: float) -> Signal:
    """Return a sine whose period changes from ``first`` to ``last`` [s]."""
    f0, f1 = 1.0 / first, 1.0 / last
    return lambda t: amplitude * math.sin(math.tau * (f0 * t + 0.5 * (f1 - f0) * t * t / duration))


def steps(size: float, every: float) -> Signal:
    """Return steps between 0 and ``size``."""
    return lambda t: size * (int(t / every) % 2)


def hand(t: float) -> float:
    """Return the motion [rad] of a hand at work: strokes of several lengths with rests between."""
    return 0.5 * math.sin(0.9 * t) * math.sin(0.37 * t) + 0.1 * math.sin(2.1 * t) ** 3


def cases() -> Iterator[Case]:
    """Yield all streams of the table."""
    for rates, jitter in itertools.product((False, True), (0.0, 0.02)):
        how = 10.0, rates, jitter
        for amplitude, period in ((0.17, 2.0), (0.4, 3.0), (0.9, 5.0)):
            signal = sine(amplitude, period)
            name = f"sine of {amplitude:g} rad, {period:g} s"
            yield Case(name, signal, period, 3.0 * period, *how)
        yield Case("hand", hand, 3.0, 20.0, *how)
    for hz in (50.0, 100.0):
        for rates in (False, True):
            for jitter in (0.0, 0.003):
                how = hz, rates, jitter
                for amplitude, period in ((0.17, 2.0), (0.4, 3.0), (0.9, 5.0), (2.4, 8.0)):
                    signal = sine(amplitude, period)
                    name = f"sine of {amplitude:g} rad, {period:g} s"
                    yield Case(name, signal, period, 3.0 * period, *how)
                slow, quick = chirp(0.3, 6.0, 2.7, 18.0), chirp(0.3, 6.0, 1.0, 18.0)
                yield Case("hand", hand, 3.0, 20.0, *how)
                yield Case("chirp of 0.3 rad, 6 to 2.7 s", slow, 3.0, 18.0, *how)
                yield Case("too fast: sine of 0.4 rad, 2 s", sine(0.4, 2.0), 2.0, 8.0, *how)
                yield Case("too fast: sine of 0.4 rad, 1 s", sine(0.4, 1.0), 2.0, 6.0, *how)
                yield Case("too fast: chirp of 0.3 rad, 6 to 1 s", quick, 3.0, 18.0, *how)
                if not rates:
                    yield Case("too fast: steps of 0.5 rad", steps(0.5, 2.0), 2.0, 8.0, *how)


PEERS: dict[str, Follower] = {
    "ours": ours,
    "ruckig": ruckigs,
    "smoothed": smoothed,
    "servo": servo_filtered,
}


def unreached(limiter: Limiter, case: Case, t: float) -> float:
    """Return the distance from the last sample [rad], 4 s after a stream that ends at ``t`` [s]."""
    ticks = Feed.of(case).ticks[: round(t / TICK)]
    last = next(samples[-1][1] for samples in reversed(ticks) if samples)
    rest: list[list[tuple[float, float, float | None]]] = [[] for _ in range(round(4.0 / TICK))]
    return abs(float(ours(limiter, Feed([*ticks, *rest]))[-1, 0]) - last)


def axis_1() -> Limiter:
    """Return a limiter of the Katana's first axis alone."""
    limits = load().require_arm().limits
    return Limiter(
        Limits(limits.lower[:1], limits.upper[:1], limits.speed[:1],
               limits.acceleration[:1], limits.jerk[:1])
    )  # fmt: skip


def main() -> None:
    """Print the table of docs/benchmarks.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hz", type=float, help="only streams of so many samples a second")
    only = parser.parse_args().hz
    limiter = axis_1()
    print(
        "| stream | Hz | qd | jitter, ms | used | beyond, % | amplitude, % | lag, ms "
        "| ruckig beyond, % | amplitude, % | error, ratio "
        "| smoothed beyond, % | amplitude, % | lag, ms "
        "| Servo amplitude, % | lag, ms | acceleration, of its limit |"
    )
    print("|---|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
    for case in cases():
        if only and case.hz != only:
            continue
        feed = Feed.of(case)
        followed = {name: follow(limiter, feed) for name, follow in PEERS.items()}
        own, other, low, servo = (judged(case, each) for each in followed.values())
        limit = float(limiter.limits.acceleration[0])
        used, pushed = case.used / limit, np.abs(followed["servo"][2:, 2]).max() / limit
        rates, jitter = "yes" if case.rates else "no", 1e3 * case.jitter
        print(
            f"| {case.name} | {case.hz:g} | {rates} | {jitter:g} "
            f"| {'-' if used > 9 else format(used, '.2f')} "
            f"| {100 * own.beyond:.2f} | {100 * own.peak:.1f} | {1e3 * own.lag:.0f} "
            f"| {100 * other.beyond:.1f} | {100 * other.peak:.1f} | {other.left / own.left:.1f} "
            f"| {100 * low.beyond:.1f} | {100 * low.peak:.1f} | {1e3 * low.lag:.0f} "
            f"| {100 * servo.peak:.1f} | {1e3 * servo.lag:.0f} | {pushed:.1f} |"
        )
    ends = [
        unreached(limiter, case, t)
        for case in cases()
        if not case.name.startswith("too fast")
        for t in (2.3, 3.1, 4.4)
    ]
    print(f"Maximum distance from the last sample of an ended stream: {max(ends):.1e} rad")


if __name__ == "__main__":
    main()
