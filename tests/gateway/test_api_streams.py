"""Test streams of joint angles to a server, and of states from it."""

from __future__ import annotations

import math
import time

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


@pytest.mark.parametrize("rates", [False, True])
def test_stream_inside_the_limits_is_not_overshot(program: Client, rates: bool) -> None:
    """The stream uses 0.7 of the acceleration."""
    program.go(requests.Home())
    began, reached = time.monotonic(), 0.0
    while (t := time.monotonic() - began) < 6.5:
        q, qd = READY.copy(), np.zeros(5)
        q[0], qd[0] = READY[0] + SIZE * math.sin(OMEGA * t), SIZE * OMEGA * math.cos(OMEGA * t)
        # The answer arrives once the server has the sample.
        program.ask(requests.Servo(q=q.tolist(), qd=qd.tolist() if rates else None))
        reached = max(reached, abs(program.query(answers.State).setpoint[0] - READY[0]))
        time.sleep(max(0.0, began + t + 0.02 - time.monotonic()))
    assert 0.9 * SIZE < reached < 1.05 * SIZE


SIZE, OMEGA = 0.4, math.tau / 3.0
"""Amplitude [rad] and maximum speed [rad/s] of a sine."""


def test_states_arrive_at_the_requested_rate(program: Client) -> None:
    times = []
    for state in program.states(hz=50.0):
        times.append(time.monotonic())
        assert len(state.q) == 5
        if len(times) == 60:
            break
    assert np.mean(np.diff(times)) == pytest.approx(0.02, abs=1e-3)
