"""The nearest feasible pose of random members of the family, against searches on the joints."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.batch import errors_of, forward_batch
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.inverse_batch import inverse_batch
from katana450.maths.kinematics.projection import project
from katana450.maths.kinematics.tool import ToolTarget
from tests.kinematics.family import Offsets, member, random_member, random_pose


def limited_member(rng: np.random.Generator, *, lateral: bool = True) -> Chain:
    """Return a member with limits of random width and place."""
    chain, _ = random_member(rng, lateral=lateral)
    middle, half = rng.uniform(-1.5, 1.5, 5), rng.uniform(0.4, 2.4, 5)
    return dataclasses.replace(chain, lower=middle - half, upper=middle + half)


def random_targets(chain: Chain, rng: np.random.Generator, n: int) -> list[FloatArray]:
    """Return poses near the feasible ones, beyond limits, and anywhere."""
    origin = se3.inverse(arm_of(chain).T_C_S)
    result = []
    for i in range(n):
        if i % 3 == 0:
            T = origin @ random_pose(rng, 0.3)
        else:
            room = 0.0 if i % 3 == 1 else 1.0
            T = forward(chain, rng.uniform(chain.lower - room, chain.upper + room))
            T[:3, :3] = T[:3, :3] @ so3.exp(0.3 * rng.normal(size=3))
        result.append(T)
    return result


def nearest_point(chain: Chain, target: FloatArray, rng: np.random.Generator) -> float:
    """Return the minimum distance [m] to the target found by a shrinking random search.

    The search stays inside the limits.
    """
    starts, samples = 10, 40
    q = rng.uniform(chain.lower, chain.upper, size=(20_000, 5))
    d = np.linalg.norm(forward_batch(chain, q)[:, :3, 3] - target, axis=1)
    best = np.argpartition(d, starts)[:starts]
    q, least, width = q[best], d[best], np.full(starts, 0.2)
    rows = np.arange(starts)
    for _ in range(120):
        step = rng.normal(size=(starts, samples, 5)) * width[:, None, None]
        # Moving few joints at a time keeps the others at their limits.
        step *= rng.random(step.shape) < 0.6
        tried = np.clip(q[:, None] + step, chain.lower, chain.upper)
        points = forward_batch(chain, tried.reshape(-1, 5))[:, :3, 3]
        d = np.linalg.norm(points - target, axis=1).reshape(starts, samples)
        k = d.argmin(axis=1)
        better = d[rows, k] < least
        q[better] = tried[rows, k][better]
        least = np.where(better, d[rows, k], least)
        width *= np.where(better, 1.3, 0.75)
    return float(least.min())


def least_rotation(chain: Chain, T: FloatArray, q0: FloatArray) -> float:
    """Return the minimum angle [rad] to `T`, its point kept, over a grid of pitches and rolls."""
    pitches, rolls = np.linspace(-math.pi, math.pi, 721), np.linspace(0.0, 1.0, 97)
    poses = [
        target.pose(chain, target.facing(chain, branch, float(q0[0])))
        for branch in BRANCHES[::2]
        for target in (ToolTarget(T[:3, 3], float(pitch), 0.0) for pitch in pitches)
    ]
    q = inverse_batch(chain, np.array(poses))
    position, rotation = errors_of(chain, q, np.array(poses))
    fits = ((q >= chain.lower) & (q <= chain.upper))[:, :, :4].all(axis=2)
    fits &= (position < 1e-9) & (rotation < 1e-9)
    q = np.repeat(q[fits][:, None], len(rolls), axis=1)
    q[:, :, 4] = chain.lower[4] + rolls * (chain.upper[4] - chain.lower[4])
    if not q.size:
        return math.inf
    R = forward_batch(chain, q.reshape(-1, 5))[:, :3, :3]
    trace = np.einsum("nij,ij->n", R, T[:3, :3]).max()
    return math.acos(min(max(0.5 * (float(trace) - 1.0), -1.0), 1.0))


@pytest.mark.cases(2)
@pytest.mark.parametrize("seed", range(8))
def test_no_search_finds_a_nearer_point_or_turn(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chain = limited_member(rng, lateral=seed % 2 == 1)
    exact = 0
    for T in random_targets(chain, rng, 9):
        p = project(chain, T)
        assert chain.within_limits(p.q, slack=0.0)
        np.testing.assert_array_equal(p.T, forward(chain, p.q))
        assert p.position_error <= nearest_point(chain, T[:3, 3], rng) + 1e-6
        if p.position_error < 1e-9:
            exact += 1
            assert p.rotation_error <= least_rotation(chain, T, p.q) + 1e-6
    assert exact > 0


def test_every_branch_has_a_solution_and_the_best_is_taken(rng: np.random.Generator) -> None:
    for _ in range(25):
        chain = limited_member(rng)
        for T in random_targets(chain, rng, 3):
            best = project(chain, T)
            each = [project(chain, T, branch=branch) for branch in BRANCHES]
            for p in (best, *each):
                assert np.isfinite(p.q).all()
                assert chain.within_limits(p.q, slack=0.0)
            nearest = min(p.position_error for p in each)
            assert best.position_error == pytest.approx(nearest, abs=2e-9)


def test_elbow_excluded_by_limits_gets_the_nearest_bend() -> None:
    offsets = Offsets(0.0, 0.0, (0.2, 0.2, 0.15), (0.0, 0.0, 0.0), 0.0, (1, 1, 1, 1, 1))
    chain = dataclasses.replace(
        member(offsets, np.eye(4), np.eye(4)),
        lower=np.array([-3.0, -2.0, 0.3, -2.0, -3.0]),
        upper=np.array([3.0, 1.0, 2.5, 2.0, 3.0]),
    )
    T = forward(chain, [0.2, -0.9, 1.1, 0.2, 0.4])
    assert project(chain, T).branch == Branch("front", "up")
    p = project(chain, T, branch=Branch("front", "down"))
    assert p.q[2] == 0.3
    assert p.position_error < 1e-12
    assert p.rotation_error > 0.1


def test_limits_beyond_the_folded_arm_hold_both_elbows() -> None:
    offsets = Offsets(0.0, 0.0, (0.2, 0.15, 0.15), (0.0, 0.0, 0.0), 0.0, (1, 1, 1, 1, 1))
    chain = dataclasses.replace(
        member(offsets, np.eye(4), np.eye(4)),
        lower=np.array([-3.0, -3.0, 0.5, -3.0, -3.0]),
        upper=np.array([3.0, 3.0, 5.0, 3.0, 3.0]),
    )
    for three, elbow in ((2.0, "up"), (4.2, "down")):
        q = np.array([0.2, -0.4, three, 0.2, 0.4])
        p = project(chain, forward(chain, q), branch=branch_of(chain, q))
        assert p.branch.elbow == elbow  # type: ignore[union-attr]
        np.testing.assert_allclose(p.q, q, atol=1e-12)


def test_inside_the_lateral_offset_the_error_is_the_smallest(rng: np.random.Generator) -> None:
    offsets = Offsets(0.02, 0.05, (0.2, 0.2, 0.15), (0.0, 0.0, 0.0), 0.0, (1, 1, 1, 1, 1))
    chain = member(offsets, np.eye(4), np.eye(4))
    for rho in (0.0, 0.02, 0.05 - 1e-6):
        T = random_pose(rng, 0.0)
        T[:3, 3] = [rho, 0.0, 0.3]
        assert project(chain, T).position_error == pytest.approx(0.05 - rho, abs=1e-12)


def test_beside_axis_1_out_of_reach_is_as_near_as_the_stretched_arm() -> None:
    offsets = Offsets(0.02, 0.05, (0.2, 0.2, 0.15), (0.0, 0.0, 0.0), 0.0, (1, 1, 1, 1, 1))
    chain = member(offsets, np.eye(4), np.eye(4))
    for angle in (0.0, 1.0, -2.0):
        p = project(chain, se3.from_rotation_translation(so3.rotation_z(angle), [0.9, 0.1, 0.0]))
        farthest = math.hypot(0.57, 0.05)
        assert p.position_error == pytest.approx(math.hypot(0.9, 0.1) - farthest, abs=1e-12)
        assert p.reach


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_beside_axis_1_the_end_that_comes_nearer_is_taken(side: float) -> None:
    """The target is in the gap of axis 1; the nearer place is not always at the nearer limit."""
    offsets = Offsets(0.0, 0.06 * side, (0.1, 0.1, 0.05), (0.0,) * 3, 0.0, (1, 1, 1, 1, 1))
    limits = np.array([2.5, 3.0, 3.0, 3.0, 3.0])
    chain = dataclasses.replace(member(offsets, np.eye(4), np.eye(4)), lower=-limits, upper=limits)
    # The plane through a far target differs less in angle from it than that of the stretched arm.
    azimuth = side * (math.pi + 0.13)
    target = 2.0 * np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    p = project(chain, se3.from_rotation_translation(np.eye(3), target), branch=BRANCHES[0])
    stretched = [math.dist(forward(chain, [end, 0, 0, 0, 0])[:3, 3], target) for end in (-2.5, 2.5)]
    assert p.q[0] == 2.5 * side
    assert p.position_error == pytest.approx(min(stretched), abs=1e-12)
    assert max(stretched) > min(stretched) + 0.01


def test_limits_wider_than_a_turn_keep_the_turn_of_the_hint(rng: np.random.Generator) -> None:
    chain, _ = random_member(rng)
    wide = dataclasses.replace(chain, lower=np.full(5, -7.0), upper=np.full(5, 7.0))
    q = np.array([0.4, -0.7, 1.0, 0.5, 5.5])
    p = project(wide, forward(wide, q), q_hint=q + 0.01)
    np.testing.assert_allclose(p.q, q, atol=1e-9)


def test_a_tool_point_beside_the_roll_axis_is_brought_to_its_target(
    rng: np.random.Generator,
) -> None:
    reached = 0
    for _ in range(30):
        chain = limited_member(rng, lateral=False)
        beside = chain.with_tool(chain.M @ random_pose(rng, 0.02))
        q = rng.uniform(chain.lower, chain.upper)
        T = forward(beside, q)
        p = project(beside, T, q_hint=q)
        assert p.position_error < 1e-12
        assert p.rotation_error < 1e-10
        T[:3, :3] = T[:3, :3] @ so3.exp(0.2 * rng.normal(size=3))
        p = project(beside, T, q_hint=q)
        assert beside.within_limits(p.q, slack=0.0)
        reached += p.position_error < 1e-9
    # Near a limit or the edge there may be no posture with the point there.
    assert reached >= 20
