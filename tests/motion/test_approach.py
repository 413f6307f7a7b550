"""Approaching a goal: at the joints' speed, together, and exactly there at the end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.motion.approach import approach

SPEED = np.array([2.0, 1.0])
angles = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2).map(np.array)


@given(q=angles, goal=angles, dt=st.floats(1e-4, 0.1))
def test_no_joint_moves_faster_than_it_can(q: np.ndarray, goal: np.ndarray, dt: float) -> None:
    step = np.abs(approach(q, goal, SPEED, dt) - q)
    assert (step <= SPEED * dt + 1e-15).all()  # 1e-15: rounding of q + step


def test_without_the_speed_limit_the_same_step_would_be_a_leap() -> None:
    q, goal = np.zeros(2), np.array([1.0, 1.0])
    assert (approach(q, goal, np.full(2, 1e9), 0.01) == goal).all()
    assert np.abs(approach(q, goal, SPEED, 0.01)).max() == pytest.approx(0.01)


@given(q=angles, goal=angles)
def test_joints_arrive_together_on_a_straight_line(q: np.ndarray, goal: np.ndarray) -> None:
    way = goal - q
    step = approach(q, goal, SPEED, 0.01) - q
    # Parallel vectors: no part of the step is square to the way.
    assert abs(step[0] * way[1] - step[1] * way[0]) < 1e-12


def test_the_goal_is_reached_exactly_in_the_time_the_slowest_joint_needs() -> None:
    q, goal = np.zeros(2), np.array([0.3, -0.4])
    ticks = 0
    while (q != goal).any():
        q = approach(q, goal, SPEED, 0.01)
        ticks += 1
        assert ticks <= 41
    assert ticks in (40, 41)  # 0.4 rad at 1 rad/s


@pytest.mark.parametrize("dt", [0.0, -1.0])
def test_nothing_moves_while_no_time_passes(dt: float) -> None:
    q = np.zeros(2)
    assert approach(q, np.ones(2), SPEED, dt) is q
