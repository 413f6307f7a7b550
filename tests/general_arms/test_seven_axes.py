"""Seven axes: reachable poses are reached inside the limits, by an arm angle that suits them."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.seven_axes import SevenAxes
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from tests.general_arms.published_arms import SEVEN

LONG = "KATANA450_LONG" in os.environ
POSES = 10_000 if LONG else 150

REACHED = 1e-6
"""[m], [rad]"""


def seven_axes(chain: Chain) -> SevenAxes:
    kinematics = kinematics_of(chain)
    assert isinstance(kinematics, SevenAxes), kinematics.method
    return kinematics


def fraction(chain: Chain, q: FloatArray) -> float:
    """Return the room to the nearest limit as a fraction of the joint's range."""
    return float((np.minimum(q - chain.lower, chain.upper - q) / (chain.upper - chain.lower)).min())


@pytest.mark.parametrize("name", SEVEN)
def test_posture_is_found_again_at_its_arm_angle(name: str) -> None:
    chain = SEVEN[name]
    solver = seven_axes(chain)
    rng = np.random.default_rng(1)
    for q in rng.uniform(chain.lower, chain.upper, (POSES, 7)):
        postures = solver.at_arm_angles(forward(chain, q), np.array([q[solver.arm_angle_joint]]))[0]
        assert np.abs(postures - q).max(axis=1).min() < 1e-6


@pytest.mark.parametrize("name", SEVEN)
def test_reachable_poses_are_reached_inside_the_limits(name: str) -> None:
    chain = SEVEN[name]
    solver = seven_axes(chain)
    rng = np.random.default_rng(2)
    reached = 0
    times = []
    for q in rng.uniform(chain.lower, chain.upper, (POSES, 7)):
        T = forward(chain, q)
        started = time.thread_time()
        solutions = list(solver.inverse(T))
        times.append(time.thread_time() - started)
        usable = [solution for solution in solutions if solution.within_limits]
        reached += any(
            solution.position_error <= REACHED and solution.rotation_error <= REACHED
            for solution in usable
        )
    assert reached >= 0.995 * POSES
    assert float(np.median(times)) <= 5e-3


@pytest.mark.parametrize("name", SEVEN)
def test_arm_angle_without_hint_keeps_room_to_the_limits(name: str) -> None:
    chain = SEVEN[name]
    solver = seven_axes(chain)
    rng = np.random.default_rng(3)
    for q in rng.uniform(chain.lower, chain.upper, (20, 7)):
        T = forward(chain, q)
        room = max(fraction(chain, solution.q) for solution in solver.inverse(T) if solution.exact)
        assert room >= fraction(chain, q) - 0.005


@pytest.mark.parametrize("name", SEVEN)
def test_small_move_from_a_hint_moves_the_joints_little(name: str) -> None:
    chain = SEVEN[name]
    solver = seven_axes(chain)
    rng = np.random.default_rng(4)
    middle, half = 0.5 * (chain.lower + chain.upper), 0.5 * (chain.upper - chain.lower)
    for _ in range(20):
        q = middle + 0.8 * half * rng.uniform(-1.0, 1.0, 7)
        T = forward(chain, q + 1e-3 * rng.normal(size=7))
        solutions = [
            solution
            for solution in solver.inverse(T, q)
            if solution.exact and solution.within_limits
        ]
        assert min(float(np.abs(solution.q - q).max()) for solution in solutions) < 0.15
