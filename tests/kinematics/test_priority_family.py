"""The priorities on random members of the family, against searches on the joints."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.state.messages import PRIORITIES
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.branch import BRANCHES, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import Projection, project
from katana450.maths.kinematics.tool import ToolTarget, pitch_and_roll
from katana450.maths.kinematics.tracker import leap
from tests.conftest import LONG
from tests.kinematics.brute_force import (
    minimum,
    nearest_point,
    on_branch,
    planes,
    postures_at,
)
from tests.kinematics.conftest import katana
from tests.kinematics.family import limited_member, random_pose
from tests.kinematics.targets import targets


def target_pitch(chain: Chain, T: FloatArray, alpha1: FloatArray) -> FloatArray:
    """Return the target pitch (k,) [rad] of the roll axis in planes at `alpha1` (k,) [rad]."""
    dx, dy, dz = arm_of(chain).pose(T)[:3, 0]
    inwards = np.cos(alpha1) * dx + np.sin(alpha1) * dy < 0.0
    return np.asarray(np.arctan2(-dz, np.where(inwards, -1.0, 1.0) * math.hypot(dx, dy)))


def least_pitch(chain: Chain, T: FloatArray, q0: FloatArray) -> float:
    """Return the minimum pitch error [rad] over a grid, with the tool point of `T` kept."""
    q = postures_at(chain, T[:3, 3], planes(chain, T[:3, 3], float(q0[0])), 2001)
    alpha = arm_of(chain).canonical(q)
    pitch = alpha[:, 1:4].sum(axis=1) - arm_of(chain).tilt
    error = (pitch - target_pitch(chain, T, alpha[:, 0]) + math.pi) % math.tau - math.pi
    return float(np.abs(error).min(initial=math.inf))


def nearest_at_pitch(
    chain: Chain, T: FloatArray, held: Projection, pitch: float, rng: np.random.Generator
) -> float:
    """Return the minimum distance [m] to the point of `T` that a random search finds.

    The search stays on the branch of `held`, keeps the `pitch`, and uses planes that see the target
    roll axis from the same side as the plane of `held`. A limit of axis 1 that holds the arm is
    assumed to be the best place of that axis.
    """
    arm, branch = arm_of(chain), held.branch
    lower, upper = np.sort((arm.canonical(chain.lower), arm.canonical(chain.upper)), axis=0)
    middle = 0.5 * (lower + upper)[3]
    side_pitch = float(target_pitch(chain, T, arm.canonical(held.q)[:1])[0])

    if 0 in held.limits:
        lower[0] = upper[0] = arm.canonical(held.q)[0]

    def distances(alpha: FloatArray) -> FloatArray:
        four = pitch + arm.tilt - alpha[:, 1] - alpha[:, 2] - middle
        alpha[:, 3] = middle + (four + math.pi) % math.tau - math.pi
        q = arm.joints(alpha)
        points = forward_batch(chain, q)[:, :3, 3]
        fits = (alpha[:, 3] >= lower[3]) & (alpha[:, 3] <= upper[3])
        fits &= np.abs(target_pitch(chain, T, alpha[:, 0]) - side_pitch) < 1e-9
        fits &= on_branch(chain, q, points, branch)  # type: ignore[arg-type]
        return np.where(fits, np.linalg.norm(points - T[:3, 3], axis=1), np.inf)

    return minimum(distances, lower, upper, rng)


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(9))
def test_no_search_satisfies_a_priority_better(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    chain = limited_member(rng, lateral=seed % 2 == 1) if seed else katana()
    number = 0
    for T in targets(chain, rng, 1)[:: 2 if LONG else 4]:
        position = project(chain, T, priority=Priority.POSITION)
        assert position.position_error <= nearest_point(chain, T[:3, 3], None, rng) + 1e-6
        if position.position_error < 1e-9:
            assert position.pitch_error <= least_pitch(chain, T, position.q) + 1e-9
        for branch in BRANCHES:
            held = project(chain, T, priority=Priority.PITCH, branch=branch)
            alpha1 = arm_of(chain).canonical(held.q)[:1]
            pitch = float(target_pitch(chain, T, alpha1)[0])
            # The tool may face away from axis 1 or towards it.
            pitches = (pitch, math.pi - pitch)
            least = [nearest_at_pitch(chain, T, held, facing, rng) for facing in pitches]
            if held.pitch_error > 1e-9:
                assert min(least) == math.inf
                continue
            number += 1
            actual, _ = pitch_and_roll(chain, held.q)
            misses = [abs(math.remainder(actual - facing, math.tau)) for facing in pitches]
            assert min(misses) <= 1e-9
            assert held.position_error <= least[int(np.argmin(misses))] + 1e-6
    assert number > 0


@pytest.mark.parametrize("priority", PRIORITIES)
def test_reachable_pose_is_unchanged_by_every_priority(
    priority: Priority, rng: np.random.Generator
) -> None:
    for _ in range(60):
        chain = limited_member(rng)
        q = rng.uniform(chain.lower, chain.upper)
        T = forward(chain, q)
        p = project(chain, T, priority=priority, branch=branch_of(chain, q), q_hint=q)
        np.testing.assert_allclose(p.q, q, atol=1e-7)
        assert p.position_error < 1e-12
        assert p.rotation_error < 1e-10
        assert p.pitch_error < 1e-9
        assert p.limits == ()


@pytest.mark.parametrize("priority", PRIORITIES)
def test_five_numbers_of_a_posture_lead_back_to_it(
    priority: Priority, rng: np.random.Generator
) -> None:
    """Also test a tool point beside the roll axis."""
    for number in range(120):
        chain = limited_member(rng)
        if number % 2:
            chain = chain.with_tool(chain.M @ random_pose(rng, 0.02))
        q = rng.uniform(chain.lower, chain.upper)
        target, branch = ToolTarget.at(chain, q), branch_of(chain, q)
        T = forward(chain, q)
        near = q + 0.01 * rng.normal(size=5)
        if number % 2 == 0:
            facing = target.facing(chain, branch, float(near[0]))
            assert math.remainder(facing - q[0], math.tau) == pytest.approx(0.0, abs=1e-9)
        np.testing.assert_allclose(target.pose(chain, float(q[0])), T, atol=1e-12)
        best = leap(chain, near, target, branch, priority)
        assert best.position_error < 1e-9
        assert best.yaw_error == 0.0
        if number % 2 == 0:
            np.testing.assert_allclose(best.q, q, atol=1e-7)
