"""A stream of joint angles is followed under every limit."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.commands import JOG_TIME
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import Servoing
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from tests.conftest import LONG

DT = 0.01

Stream = Callable[[float], FloatArray]


def streamed(
    session: Session, stream: Stream, seconds: float, every: int = 2
) -> tuple[list[float], list[State]]:
    """Return times and states of ticks, with a sample of the stream in each ``every``-th tick."""
    states, times = [session.begin(session.ready, 0.0, 0.0)], [0.0]
    for tick in range(1, int(seconds / DT)):
        t = tick * DT
        commands = [cmd.Servo(stream(t))] if tick % every == 0 else []
        state = session.step(states[-1], commands, t)
        states.append(session.observe(state, state.setpoint, state.gripper_setpoint))
        times.append(t)
    return times, states


def wave(session: Session, size: float = 0.2, period: float = 6.0) -> Stream:
    """Return a stream to and fro about the ready posture, from rest."""

    def at(t: float) -> FloatArray:
        return session.ready + size * math.sin(math.tau * t / period) ** 2 * np.array(
            (1.0, 0.3, 0.5, -0.4, 1.5)
        )

    return at


def on_axis_1(session: Session, signal: Callable[[float], float]) -> Stream:
    """Return a stream in which axis 1 follows ``signal``, and the others stay."""
    return lambda t: session.ready + np.array((signal(t), 0.0, 0.0, 0.0, 0.0))


def arriving(
    session: Session,
    signal: Callable[[float], float],
    seconds: float,
    hz: float = 50.0,
    jitter: float = 0.0,
    rates: bool = False,
) -> list[State]:
    """Return the states of ticks with samples that arrive late by ``jitter`` [s] on average.

    Each sample is stamped with its arrival, as on a server. Limits are checked in every tick.
    """
    rng, limits = np.random.default_rng(3), session.require_arm().limits
    sent = np.arange(0.0, seconds, 1.0 / hz)
    arrived = np.maximum.accumulate(sent + 0.004 + rng.exponential(jitter, len(sent)))
    stream, due = on_axis_1(session, signal), 0
    states = [session.begin(session.ready, 0.0, 0.0)]
    for tick in range(1, int(seconds / DT)):
        t, commands = tick * DT, []
        while due < len(sent) and arrived[due] <= t:
            s = float(sent[due])
            qd = (stream(s + 1e-6) - stream(s - 1e-6)) / 2e-6 if rates else None
            commands.append(cmd.Servo(stream(s), qd).timed(float(arrived[due])))
            due += 1
        state = session.step(states[-1], commands, t)
        before, now = states[-1].motion, state.motion
        assert (np.abs(now.qd) <= limits.speed + 1e-9).all()
        assert (np.abs(now.qdd) <= limits.acceleration + 1e-9).all()
        assert (np.abs(now.qdd - before.qdd) <= limits.jerk * DT + 1e-6).all()
        states.append(session.observe(state, state.setpoint, state.gripper_setpoint))
    return states


def lag_and_error(
    states: list[State], signal: Callable[[float], float], since: float
) -> tuple[float, float]:
    """Return the lag [s] that explains axis 1 best, and the remaining error [rad]."""
    late = [state for state in states if state.t > since]
    errors = []
    for lag in np.arange(-0.02, 0.12, 0.002).tolist():
        off = [abs(state.setpoint[0] - signal(state.t - lag)) for state in late]
        errors.append((max(off), lag))
    error, lag = min(errors)
    return lag, error


@pytest.mark.cases(3)
@pytest.mark.parametrize("rates", [False, True])
@pytest.mark.parametrize("hz", [50.0, 100.0])
@pytest.mark.parametrize("jitter", [0.0, 0.003])
@pytest.mark.parametrize(
    ("size", "period"),
    [
        (0.4, 3.0),
        pytest.param(0.17, 2.0, marks=pytest.mark.long),
        pytest.param(0.7, 5.0, marks=pytest.mark.long),
    ],
)
def test_sine_inside_the_limits_keeps_its_amplitude(
    session: Session, size: float, period: float, jitter: float, hz: float, rates: bool
) -> None:
    """The sines use 0.45 to 0.7 of the maximum acceleration."""

    def sine(t: float) -> float:
        return size * math.sin(math.tau * t / period)

    states = arriving(session, sine, (3.0 if LONG else 2.0) * period, hz, jitter, rates)
    # The whole time is checked, because it must not overshoot while it catches up either.
    assert max(abs(state.setpoint[0]) for state in states) == pytest.approx(size, rel=5e-3)
    lag, error = lag_and_error(states, sine, period)
    assert lag <= (0.03 if rates else 0.06)
    assert error <= (0.012 if rates or not jitter else 0.04) * size


@pytest.mark.cases(2)
@pytest.mark.parametrize("rates", [False, True])
@pytest.mark.parametrize("period", [0.8, 1.0, pytest.param(1.5, marks=pytest.mark.long), 2.0])
def test_sine_beyond_the_limits_is_clipped_without_overshoot(
    session: Session, period: float, rates: bool
) -> None:
    def sine(t: float) -> float:
        return 0.4 * math.sin(math.tau * t / period)

    states = arriving(session, sine, 8.0, 50.0, 0.002, rates)
    assert 0.1 < max(abs(state.setpoint[0]) for state in states) <= 0.4 * (1.0 + 1e-3)


def test_chirp_that_becomes_too_fast_is_hardly_overshot(session: Session) -> None:
    """The period falls from 6 s to 1 s; the session cannot know in advance when it is too fast."""
    seconds = 18.0 if LONG else 14.0

    def chirp(t: float) -> float:
        return 0.3 * math.sin(math.tau * (t / 6.0 + 0.5 * (1.0 - 1.0 / 6.0) * t * t / seconds))

    states = arriving(session, chirp, seconds)
    assert max(abs(state.setpoint[0]) for state in states) <= 0.3 * 1.01


def test_steps_are_reached_without_overshoot(session: Session) -> None:
    def steps(t: float) -> float:
        return 0.5 * (int(t / 2.0) % 2)

    q = np.array([state.setpoint[0] for state in arriving(session, steps, 8.0, jitter=0.002)])
    assert q.min() >= -1e-4
    assert q.max() <= 0.5 + 1e-4
    assert q[int(3.9 / DT)] == pytest.approx(0.5, abs=1e-3)
    assert q[int(5.9 / DT)] == pytest.approx(0.0, abs=1e-3)


def test_samples_that_arrive_together_make_no_leap(session: Session) -> None:
    """A connection stalls for 0.1 s, and then delivers all samples at once."""

    def sine(t: float) -> float:
        return 0.4 * math.sin(math.tau * t / 3.0)

    stream, state = on_axis_1(session, sine), session.begin(session.ready, 0.0, 0.0)
    for tick in range(1, 900 if LONG else 500):
        t, commands = tick * DT, []
        if tick % 2 == 0 and tick % 100 > 10:
            commands = [cmd.Servo(stream(t)).timed(t)]
        if tick % 100 == 10:
            commands = [cmd.Servo(stream(t - late)).timed(t) for late in (0.08, 0.04, 0.0)]
        state = session.step(state, commands, t)
        assert abs(state.setpoint[0]) <= 0.4 * 1.05


def test_time_of_another_clock_is_ignored(session: Session, state: State) -> None:
    for t in (-5.0, 1e6):
        after = session.step(state, [cmd.Servo(session.ready).timed(t)], DT)
        assert after.servo is not None
        assert after.servo.t == DT
    with pytest.raises(InputError, match="time"):
        cmd.Servo(session.ready).timed(math.nan)


@pytest.mark.cases(2)
@pytest.mark.parametrize("every", [1, 2, 5])
def test_feasible_stream_is_followed_closely(session: Session, every: int) -> None:
    stream = wave(session)
    times, states = streamed(session, stream, 6.0, every)
    off = [np.abs(s.setpoint - stream(t)).max() for t, s in zip(times, states, strict=True)]
    # Without the rate it would lag by the path of a third of a second, 0.1 rad. A slow stream is
    # read between its samples.
    assert max(off[100:]) < max(0.012, 0.33 * every * DT)


def test_ended_stream_rests_at_its_last_sample(session: Session) -> None:
    stream = wave(session)
    _, states = streamed(session, stream, 1.0)
    state = states[-1]
    last = stream(0.98)
    for _ in range(300):
        state = session.step(state, (), state.t + DT)
    assert np.abs(state.setpoint - last).max() < 1e-9
    q = state.setpoint
    state = session.step(state, (), state.t + DT)
    assert np.abs(state.setpoint - q).max() < 1e-9


@pytest.mark.cases(2)
@pytest.mark.parametrize("rates", [False, True])
@pytest.mark.parametrize("jitter", [0.0, 0.02])
def test_slow_uneven_stream_is_followed_without_overshoot(
    session: Session, jitter: float, rates: bool
) -> None:
    size = 0.3

    def signal(t: float) -> float:
        return size * math.sin(math.tau * min(t, 3.9) / 3.0)

    states = arriving(session, signal, 5.0, hz=10.0, jitter=jitter, rates=rates)
    q = np.array([state.setpoint[0] for state in states]) - session.ready[0]
    assert np.abs(q).max() < 1.03 * size
    # The signal stops at 3.9 s, and the samples end at 4.9 s.
    assert q[-1] == pytest.approx(signal(3.9), abs=1e-3)


def test_arm_that_has_not_followed_rests_where_the_stream_ends(session: Session) -> None:
    """The samples leap by 2 rad, which the arm does not follow within JOG_TIME."""
    far = on_axis_1(session, lambda _: 2.0)
    _, states = streamed(session, far, 0.2)
    state, rate = states[-1], float(np.abs(states[-1].motion.qd).max())
    for _ in range(300):
        state = session.step(state, (), state.t + DT)
        rate = max(rate, float(np.abs(state.motion.qd).max()))
    assert state.motion.at_rest
    assert state.setpoint[0] - session.ready[0] < 2.0 * JOG_TIME * rate + 0.2


def test_sample_drives_the_fingers_too(session: Session, state: State) -> None:
    gripper = session.require_arm().gripper
    target = gripper.clamp(0.5 * (gripper.opened + gripper.closed))
    for _ in range(3):
        state = session.step(state, [cmd.Servo(session.ready, gripper=target)], state.t + DT)
        state = session.step(state, [cmd.Servo(session.ready)], state.t + DT)
        # A sample without them leaves the fingers on their way.
        assert state.gripper_goal == target
    assert isinstance(state.mode, Servoing)
    for _ in range(500):
        state = session.step(state, (), state.t + DT)
    assert state.gripper_setpoint == pytest.approx(target, abs=1e-9)
    with pytest.raises(InputError, match="finger angle"):
        cmd.Servo(session.ready, gripper=math.inf)


def test_stream_of_another_shape_is_refused(session: Session) -> None:
    with pytest.raises(InputError, match="5 joints"):
        session.check(cmd.Servo(np.zeros(4)))
    with pytest.raises(InputError, match="finite"):
        cmd.Servo(np.full(5, np.nan))
