"""A stream of joint angles is kept up with, under every limit."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from app.control import commands as cmd
from app.control.arm import Arm
from app.control.commands import JOG_TIME
from app.control.session import Session
from app.control.state import State
from app.errors import InputError
from app.geometry.arrays import FloatArray

DT = 0.01

Stream = Callable[[float], FloatArray]


def streamed(
    session: Session, stream: Stream, seconds: float, every: int = 2
) -> tuple[list[float], list[State]]:
    """Ticks, with one of the stream in each ``every``-th."""
    states, times = [session.begin(session.ready, 0.0, 0.0)], [0.0]
    for tick in range(1, int(seconds / DT)):
        t = tick * DT
        commands = [cmd.Servo(stream(t))] if tick % every == 0 else []
        state = session.step(states[-1], commands, t)
        states.append(session.observe(state, state.setpoint, state.gripper_setpoint))
        times.append(t)
    return times, states


def wave(session: Session, size: float = 0.2, period: float = 6.0) -> Stream:
    """To and fro about the ready posture, from rest."""

    def at(t: float) -> FloatArray:
        return session.ready + size * math.sin(math.tau * t / period) ** 2 * np.array(
            (1.0, 0.3, 0.5, -0.4, 1.5)
        )

    return at


@pytest.mark.parametrize("every", [1, 2, 5])
def test_it_keeps_up_closely_with_what_the_arm_can_do(session: Session, every: int) -> None:
    stream = wave(session)
    times, states = streamed(session, stream, 6.0, every)
    off = [np.abs(s.setpoint - stream(t)).max() for t, s in zip(times, states, strict=True)]
    # Without the rate it would lag by a third of a second's way, 0.1 rad.
    assert max(off[100:]) < 0.012


def test_no_limit_is_passed_whatever_is_streamed(session: Session, arm: Arm) -> None:
    rng = np.random.default_rng(7)
    limits = arm.limits

    def wild(_t: float) -> FloatArray:
        return rng.uniform(arm.chain.lower - 0.5, arm.chain.upper + 0.5)

    _, states = streamed(session, wild, 5.0, 3)
    q = np.array([state.setpoint for state in states])
    qd = np.array([state.motion.qd for state in states])
    qdd = np.array([state.motion.qdd for state in states])
    assert (q >= limits.lower).all()
    assert (q <= limits.upper).all()
    assert (np.abs(qd) <= limits.speed + 1e-9).all()
    assert (np.abs(qdd) <= limits.acceleration + 1e-9).all()
    assert (np.abs(np.diff(qdd, axis=0)) / DT <= limits.jerk + 1e-6).all()
    assert (np.abs(np.diff(q, axis=0)) / DT <= limits.speed + 1e-9).all()


def test_a_stream_that_ends_leads_to_rest_at_its_last(session: Session) -> None:
    stream = wave(session)
    _, states = streamed(session, stream, 1.0)
    state = states[-1]
    last = stream(0.98)
    for _ in range(300):
        state = session.step(state, (), state.t + DT)
    # It goes along for as long as a jog would, and then stays.
    assert np.abs(state.setpoint - last).max() < 0.15 * JOG_TIME + 0.1
    q = state.setpoint
    state = session.step(state, (), state.t + DT)
    assert np.abs(state.setpoint - q).max() < 1e-9


def test_any_other_command_ends_it(session: Session) -> None:
    _, states = streamed(session, wave(session), 1.0)
    for command in (cmd.Home(), cmd.Reset(), cmd.Stop(), cmd.SetJoint(0, 0.1)):
        state = session.step(states[-1], [command], states[-1].t + DT)
        assert state.servo is None


def test_a_stream_of_another_shape_is_refused(session: Session) -> None:
    with pytest.raises(InputError, match="5 joints"):
        session.check(cmd.Servo(np.zeros(4)))
    with pytest.raises(InputError, match="finite"):
        cmd.Servo(np.full(5, np.nan))
