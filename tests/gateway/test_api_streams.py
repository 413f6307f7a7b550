"""Test streams of joint angles to a real server, and of states from it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest

from katana450.client import Client
from katana450.server.api import answers, requests
from tests.gateway.postures import READY, THERE


def test_joint_stream_is_followed_and_ends_at_rest(program: Client) -> None:
    began = time.monotonic()
    while (t := time.monotonic() - began) < 1.5:
        wave = READY + math.sin(2.0 * t) * np.array((0.2, 0.0, 0.0, 0.0, 0.4))
        program.send(requests.Servo(q=wave.tolist()))
        time.sleep(0.02)
    moving = program.query(answers.State)
    assert abs(np.array(moving.qd)[0]) > 0.05
    time.sleep(1.2)
    rest = program.query(answers.State)
    assert not rest.moving
    # The arm braked at once and did not continue to the last target of the stream.
    assert abs(rest.q[0] - 0.2 * math.sin(2.0 * 1.5)) < 0.2
    # A target of another kind stays until it is reached.
    there = program.joints(THERE)
    np.testing.assert_allclose(there.q, THERE, rtol=0, atol=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("rates", [False, True])
def test_stream_inside_the_limits_is_not_overshot(program: Client, rates: bool) -> None:
    """The stream uses 0.7 of the acceleration, and its samples are late on a busy machine.

    Until the next sample the arm continues at the speed of the last, so the bound includes the
    effect of that delay.
    """
    # With a better stream the bound is tighter.
    for _ in range(3):
        reached, bound, sent = followed(program, rates)
        if bound < 1.1 * SIZE:
            break
    assert reached < 1.05 * bound
    assert reached > 0.9 * sent


def followed(program: Client, rates: bool) -> tuple[float, float, float]:
    """Stream the sine twice; return the maximum angles [rad] reached, allowed and sent."""
    program.go(requests.Home())
    acceleration = program.query(answers.Arm).acceleration[0]
    began, seen, sent = time.monotonic(), [0.0], []
    while (t := time.monotonic() - began) < 6.5:
        sample = sine(t)
        q, qd = READY.copy(), np.zeros(5)
        q[0], qd[0] = READY[0] + sample.q, sample.qd
        # The answer arrives once the server has the sample.
        program.ask(requests.Servo(q=q.tolist(), qd=qd.tolist() if rates else None))
        sent.append(replace(sample, taken=time.monotonic() - began))
        seen.append(program.query(answers.State).setpoint[0] - READY[0])
        time.sleep(max(0.0, began + t + 0.02 - time.monotonic()))
    loop = program.query(answers.Loop)
    bound = reach(sent, loop.late_max, acceleration)
    reached = max(abs(each) for each in seen)
    print(f"reached {reached:.4f} rad, bound {bound:.4f} rad")
    return reached, bound, max(abs(each.q) for each in sent)


SIZE, OMEGA = 0.4, math.tau / 3.0
"""Amplitude [rad] and maximum speed [rad/s] of the sine."""


@dataclass(frozen=True)
class Sample:
    """Angle [rad] and speed [rad/s] of the sine at ``t`` [s]; ``taken``: time of its receipt."""

    t: float
    q: float
    qd: float
    taken: float


def sine(t: float) -> Sample:
    return Sample(t, SIZE * math.sin(OMEGA * t), SIZE * OMEGA * math.cos(OMEGA * t), t)


def reach(samples: list[Sample], late: float, acceleration: float) -> float:
    """Return the maximum angle [rad] that an arm can reach while it follows ``samples``.

    The arm continues at the speed of a sample until the next arrives, for at most 0.2 s, and then
    brakes. ``late``: delay of its control loop [s].
    """
    farthest = 0.0
    for sample, following in pairwise(samples):
        side = math.copysign(1.0, sample.qd)
        gap = min(following.taken - sample.t, 0.2) + late
        braking = sample.qd**2 / (2.0 * acceleration)
        farthest = max(farthest, side * sample.q + abs(sample.qd) * gap + braking)
    return farthest


@pytest.mark.parametrize(("gap", "bound"), [(0.02, 1.01), (0.06, 1.05)])
def test_bound_of_a_punctual_stream_is_its_amplitude(gap: float, bound: float) -> None:
    samples = [sine(gap * i) for i in range(round(3.0 / gap) + 1)]
    assert SIZE < reach(samples, 0.005, 2.5) < bound * SIZE


def test_states_arrive_at_the_requested_rate(program: Client) -> None:
    times = []
    for state in program.states(hz=50.0):
        times.append(time.monotonic())
        assert len(state.q) == 5
        if len(times) == 60:
            break
    # A busy machine may send fewer states, never more.
    assert 0.019 < np.mean(np.diff(times)) < 0.04
