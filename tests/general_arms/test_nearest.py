"""The nearest posture inside the limits, and what keeps an arm from more, in words."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.nearest import nearest_pose
from katana450.maths.geometry import so3
from katana450.maths.kinematics.forward import forward
from tests.general_arms.published_arms import (
    FOUR,
    KR_6,
    PANDA,
    PINCHERX_100,
    SEVEN,
    SIX,
    SKEWED,
    UR5E,
)

ARMS = FOUR | SIX | SEVEN | SKEWED


@pytest.mark.parametrize("name", ARMS)
def test_pose_that_the_arm_can_take_is_taken(name: str) -> None:
    chain = ARMS[name]
    rng = np.random.default_rng(1)
    for q in rng.uniform(chain.lower, chain.upper, (10, chain.n)):
        best = nearest_pose(kinematics_of(chain), forward(chain, q))
        assert best.reason == ""
        assert best.limits == ()
        assert chain.within_limits(best.q)
        assert best.position_error < 1e-6
        np.testing.assert_allclose(best.T, forward(chain, best.q))


@pytest.mark.parametrize("name", ARMS)
def test_pose_out_of_reach_has_the_distance_in_words(name: str) -> None:
    chain = ARMS[name]
    T = np.eye(4)
    T[:3, 3] = (4.0, 0.5, 0.3)
    best = nearest_pose(kinematics_of(chain), T)
    assert chain.within_limits(best.q)
    assert f"{1e3 * best.position_error:.0f} mm out of reach" in best.reason
    # The arm points at the target: no other posture is much nearer.
    rng = np.random.default_rng(2)
    others = [forward(chain, q) for q in rng.uniform(chain.lower, chain.upper, (300, chain.n))]
    assert best.position_error < min(math.dist(T[:3, 3], each[:3, 3]) for each in others)


def test_limit_that_holds_the_arm_is_named() -> None:
    narrow = dataclasses.replace(KR_6, upper=np.array([0.5, *KR_6.upper[1:]]))
    q = np.array([1.2, -1.0, 1.0, 0.2, 0.3, 0.1])
    T = forward(KR_6, q)
    best = nearest_pose(kinematics_of(narrow), T, q_hint=q)
    if best.position_error > 1e-6 or best.rotation_error > 1e-6:
        assert 0 in best.limits
        assert "axis 1 at its limit of 28.65°" in best.reason
    free = nearest_pose(kinematics_of(narrow), T, q_hint=q, within_limits=False)
    assert free.position_error < 1e-9
    assert free.limits == ()


def test_four_axes_keep_the_position_and_lose_the_turn() -> None:
    T = forward(PINCHERX_100, np.array([0.4, 0.2, -0.3, 0.5]))
    T[:3, :3] = T[:3, :3] @ so3.rotation_x(0.3)
    best = nearest_pose(kinematics_of(PINCHERX_100), T)
    assert best.position_error < 1e-6
    assert best.rotation_error == pytest.approx(0.3, abs=1e-3)
    assert best.reason == "orientation gives way by 17°"


def test_posture_nearest_to_the_hint_is_chosen() -> None:
    for chain in (UR5E, PANDA):
        rng = np.random.default_rng(3)
        middle, half = 0.5 * (chain.lower + chain.upper), 0.3 * (chain.upper - chain.lower)
        for _ in range(10):
            q = middle + half * rng.uniform(-1.0, 1.0, chain.n)
            best = nearest_pose(kinematics_of(chain), forward(chain, q), q_hint=q)
            assert np.abs(best.q - q).max() < 0.15


@pytest.mark.parametrize("name", SIX)
def test_point_that_the_tool_can_take_is_not_out_of_reach(name: str) -> None:
    chain = SIX[name]
    rng = np.random.default_rng(5)
    for q in rng.uniform(chain.lower, chain.upper, (20, chain.n)):
        T = forward(chain, q)
        T[:3, :3] = T[:3, :3] @ so3.exp(rng.normal(size=3))
        best = nearest_pose(kinematics_of(chain), T)
        assert "out of reach" not in best.reason
