"""The numerical fallback: reach, residual and limits."""

from __future__ import annotations

import dataclasses
import math
import os
import time

import numpy as np
import pytest

from katana450.extensions.general_arms.links import links_of
from katana450.extensions.general_arms.numerical import Numerical
from katana450.extensions.general_arms.tool_motion import tool_and_jacobian
from katana450.maths.geometry import se3, so3
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space
from tests.general_arms.published_arms import FOUR, KR_6, PUMA_560, SEVEN, SIX, SKEWED, SKEWED_6

LONG = "KATANA450_LONG" in os.environ
POSES = 10_000 if LONG else 100
ARMS = FOUR | SIX | SEVEN | SKEWED

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
        here = se3.from_rotation_translation(np.reshape(pose[:9], (3, 3)).T, np.array(pose[9:]))
        T = forward(chain, q)
        np.testing.assert_allclose(links.T_S_1 @ here, T, atol=1e-13)
        # Twists of the tool point, turned into {S}.
        R = links.T_S_1[:3, :3]
        J = jacobian_space(chain, q)
        np.testing.assert_allclose(R @ np.array(axes)[:, :3].T, J[:3], atol=1e-13)
        at_tool = J[3:] + np.cross(J[:3], T[:3, 3], axis=0)
        np.testing.assert_allclose(R @ np.array(axes)[:, 3:].T, at_tool, atol=1e-13)


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
        (found,) = solver.inverse(T)
        times.append(time.thread_time() - started)
        assert found.within_limits
        reached += found.position_error <= REACHED and found.rotation_error <= REACHED
    assert reached >= 0.995 * POSES
    assert float(np.median(times)) <= 5e-3


def test_search_begins_at_the_hint() -> None:
    rng = np.random.default_rng(3)
    solver = numerical(SKEWED_6)
    for q in rng.uniform(-2.0, 2.0, (30, 6)):
        T = forward(SKEWED_6, q + 1e-3 * rng.normal(size=6))
        (found,) = solver.inverse(T, q)
        assert np.abs(found.q - q).max() < 0.2


def test_same_pose_gives_the_same_posture() -> None:
    T = forward(SKEWED_6, np.full(6, 0.4))
    assert numerical(SKEWED_6).solve(T) == numerical(SKEWED_6).solve(T)


def test_rotation_by_half_a_turn_is_followed() -> None:
    solver = numerical(KR_6)
    q = np.array([0.2, -1.0, 0.9, 0.3, 0.8, -0.4])
    T = forward(KR_6, q)
    T[:3, :3] = T[:3, :3] @ so3.rotation_x(math.pi)
    (found,) = solver.inverse(T, q)
    assert found.exact


def test_pose_out_of_reach_gets_its_residual() -> None:
    T = se3.from_rotation_translation(np.eye(3), np.array([5.0, 0.0, 0.3]))
    (found,) = numerical(SKEWED_6).inverse(T)
    assert found.within_limits
    assert not found.exact
    assert 3.0 < found.position_error < 5.0
    assert found.position_error == pytest.approx(
        math.dist(forward(SKEWED_6, found.q)[:3, 3], T[:3, 3])
    )


def test_limits_are_kept_where_they_forbid_the_pose() -> None:
    narrow = dataclasses.replace(PUMA_560, lower=np.full(6, -0.3), upper=np.full(6, 0.3))
    T = forward(PUMA_560, [0.9, 0.1, 0.1, 0.1, 0.2, 0.1])
    (found,) = numerical(narrow).inverse(T)
    assert found.within_limits
    assert not found.exact
    assert found.q[0] == pytest.approx(0.3)
