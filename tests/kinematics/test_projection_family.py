"""The nearest feasible pose of members of the family, against searches on the joints."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from katana450.maths.geometry import se3, so3
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.projection import project
from tests.conftest import LONG
from tests.kinematics.brute_force import least_rotation, nearest_point, planes, postures_at
from tests.kinematics.conftest import katana
from tests.kinematics.family import Offsets, limited_member, member, random_member, random_pose
from tests.kinematics.targets import targets

# Limits so narrow that axis 1 cannot face every target, or the wrist cannot straighten, or the tool
# can only fold back over the arm.
NARROW = (
    ([-0.5, -2.6, -0.9, 0.5, -1.0], [0.6, 0.1, 1.2, 1.8, 1.0]),
    ([-2.0, -2.6, -0.4, 2.0, -1.0], [2.0, 0.1, 0.3, 3.3, 1.0]),
    ([-0.5, -1.4, -0.9, -1.0, -0.4], [0.6, 0.1, 1.2, 0.8, 0.3]),
    ([-0.4, -2.6, -3.1, -2.8, -1.0], [0.3, -0.9, 3.1, 2.9, 0.2]),
)

ARMS = {
    "katana": katana(),
    **{
        f"katana with narrow limits {number}": dataclasses.replace(
            katana(), lower=np.array(lower), upper=np.array(upper)
        )
        for number, (lower, upper) in enumerate(NARROW)
    },
    **{
        f"member {seed}": limited_member(np.random.default_rng(seed), lateral=seed % 2 == 1)
        for seed in range(8)
    },
}


@pytest.mark.cases(3)
@pytest.mark.parametrize("branch", [None, *BRANCHES], ids=str)
@pytest.mark.parametrize("name", ARMS)
def test_no_search_finds_a_nearer_point_or_turn(
    name: str, branch: Branch | None, rng: np.random.Generator
) -> None:
    chain, exact = ARMS[name], 0
    for T in targets(chain, rng, 1 if branch else 2):
        p = project(chain, T, branch=branch)
        assert chain.within_limits(p.q, slack=0.0)
        np.testing.assert_array_equal(p.T, forward(chain, p.q))
        point = p.T[:3, 3]
        if p.position_error > 1e-9:
            assert p.position_error <= nearest_point(chain, T[:3, 3], branch, rng) + 1e-6
        exact += p.position_error < 1e-9
        branches = BRANCHES if branch is None else (branch,)
        q = postures_at(chain, point, planes(chain, point, float(p.q[0])), 721, branches)
        assert p.rotation_error <= least_rotation(chain, T, q) + 1e-6


def test_every_branch_has_a_solution_and_the_best_is_taken(rng: np.random.Generator) -> None:
    for _ in range(25 if LONG else 8):
        chain = limited_member(rng)
        for T in targets(chain, rng, 1):
            best = project(chain, T)
            projections = [project(chain, T, branch=branch) for branch in BRANCHES]
            for p in (best, *projections):
                assert np.isfinite(p.q).all()
                assert chain.within_limits(p.q, slack=0.0)
            nearest = min(p.position_error for p in projections)
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
        other = chain.with_tool(chain.M @ random_pose(rng, 0.02))
        q = rng.uniform(chain.lower, chain.upper)
        T = forward(other, q)
        p = project(other, T, q_hint=q)
        assert p.position_error < 1e-12
        assert p.rotation_error < 1e-10
        T[:3, :3] = T[:3, :3] @ so3.exp(0.2 * rng.normal(size=3))
        p = project(other, T, q_hint=q)
        assert other.within_limits(p.q, slack=0.0)
        reached += p.position_error < 1e-9
    # Near a limit or the edge there may be no posture with the point there.
    assert reached >= 20
