"""The nearest posture inside the limits, and what keeps an arm from more, in words."""

from __future__ import annotations

import dataclasses
import math
import os
import time

import numpy as np
import pytest

from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.links import links_of
from katana450.extensions.general_arms.nearest import nearest_pose
from katana450.extensions.general_arms.numerical import Numerical, tool_and_jacobian
from katana450.maths.geometry import se3, so3
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space
from tests.general_arms.published_arms import (
    FOUR,
    KR_6,
    PINCHERX_100,
    PUMA_560,
    SEVEN,
    SIX,
    SKEWED,
    SKEWED_6,
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
    reached = forward(chain, best.q)[:3, 3]
    assert best.position_error == pytest.approx(math.dist(reached, T[:3, 3]))
    assert f"{1e3 * best.position_error:.0f} mm out of reach" in best.reason
    # The arm points at the target: no other posture is much nearer.
    rng = np.random.default_rng(2)
    others = [forward(chain, q) for q in rng.uniform(chain.lower, chain.upper, (300, chain.n))]
    assert best.position_error < min(math.dist(T[:3, 3], pose[:3, 3]) for pose in others)


def test_limit_that_holds_the_arm_is_named() -> None:
    lower, upper = KR_6.lower.copy(), KR_6.upper.copy()
    lower[0], upper[0] = -0.5, 0.5
    narrow = dataclasses.replace(KR_6, lower=lower, upper=upper)
    q = np.array([1.2, -1.0, 1.0, 0.2, 0.3, 0.1])
    T = forward(KR_6, q)
    best = nearest_pose(kinematics_of(narrow), T, q_hint=q)
    assert best.limits == (0,)
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


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", SIX)
def test_point_that_the_tool_can_take_is_not_out_of_reach(name: str) -> None:
    chain = SIX[name]
    rng = np.random.default_rng(5)
    for q in rng.uniform(chain.lower, chain.upper, (20, chain.n)):
        T = forward(chain, q)
        T[:3, :3] = T[:3, :3] @ so3.exp(rng.normal(size=3))
        best = nearest_pose(kinematics_of(chain), T)
        assert "out of reach" not in best.reason


LONG = "KATANA450_LONG" in os.environ
POSES = 10_000 if LONG else 100

REACHED = 1e-6
"""[m], [rad]"""


def numerical(chain: Chain) -> Numerical:
    return Numerical(chain, links_of(chain, exact=False))


@pytest.mark.parametrize("name", ARMS)
def test_plain_floats_are_the_forward_kinematics_and_the_jacobian(name: str) -> None:
    chain = ARMS[name]
    links = links_of(chain, exact=False)
    state = tool_and_jacobian(links)
    rng = np.random.default_rng(1)
    for q in rng.uniform(chain.lower, chain.upper, (10, chain.n)):
        pose, axes = state(q.tolist())
        T_1_tool = se3.from_rotation_translation(np.reshape(pose[:9], (3, 3)).T, np.array(pose[9:]))
        T = forward(chain, q)
        np.testing.assert_allclose(links.T_S_1 @ T_1_tool, T, atol=1e-13)
        # Twists of the tool point, turned into {S}.
        R = links.T_S_1[:3, :3]
        J = jacobian_space(chain, q)
        np.testing.assert_allclose(R @ np.array(axes)[:, :3].T, J[:3], atol=1e-13)
        at_tool = J[3:] + np.cross(J[:3], T[:3, 3], axis=0)
        np.testing.assert_allclose(R @ np.array(axes)[:, 3:].T, at_tool, atol=1e-13)


@pytest.mark.cases(6)
@pytest.mark.parametrize("name", ARMS)
def test_reachable_poses_are_reached_inside_the_limits_in_time(name: str) -> None:
    chain = ARMS[name]
    solver = numerical(chain)
    solver.solve(chain.M)
    rng = np.random.default_rng(2)
    reached, times = 0, []
    for q in rng.uniform(chain.lower, chain.upper, (POSES, chain.n)):
        T = forward(chain, q)
        started = time.thread_time()
        (solution,) = solver.inverse(T)
        times.append(time.thread_time() - started)
        assert solution.within_limits
        reached += solution.position_error <= REACHED and solution.rotation_error <= REACHED
    assert reached >= 0.995 * POSES
    assert float(np.median(times)) <= 5e-3


def test_search_begins_at_the_hint() -> None:
    rng = np.random.default_rng(3)
    solver = numerical(SKEWED_6)
    for q in rng.uniform(-2.0, 2.0, (30, 6)):
        T = forward(SKEWED_6, q + 1e-3 * rng.normal(size=6))
        (solution,) = solver.inverse(T, q)
        assert np.abs(solution.q - q).max() < 0.2


def test_same_pose_gives_the_same_posture() -> None:
    T = forward(SKEWED_6, np.full(6, 0.4))
    assert numerical(SKEWED_6).solve(T) == numerical(SKEWED_6).solve(T)


def test_rotation_by_half_a_turn_is_followed() -> None:
    solver = numerical(KR_6)
    q = np.array([0.2, -1.0, 0.9, 0.3, 0.8, -0.4])
    T = forward(KR_6, q)
    T[:3, :3] = T[:3, :3] @ so3.rotation_x(math.pi)
    (solution,) = solver.inverse(T, q)
    assert solution.exact


def test_limits_are_kept_where_they_forbid_the_pose() -> None:
    narrow = dataclasses.replace(PUMA_560, lower=np.full(6, -0.3), upper=np.full(6, 0.3))
    T = forward(PUMA_560, [0.9, 0.1, 0.1, 0.1, 0.2, 0.1])
    (solution,) = numerical(narrow).inverse(T)
    assert solution.within_limits
    assert not solution.exact
    assert solution.q[0] == pytest.approx(0.3)
