"""Maps of arms outside the five-axis family: what counts is possible, and vice versa."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.reachability import reachability as map_module
from katana450.extensions.reachability.reachability import (
    POSES,
    PoseSolver,
    Reachability,
    reachability_map,
    rotations,
    voxel_ranges,
)
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, joint_frames
from tests.conftest import LONG
from tests.general_arms.published_arms import (
    KR_6,
    OPENMANIPULATOR_X,
    PANDA,
    SKEWED_6,
    UR5E,
)
from tests.workspace.base_frame import in_base

STAND = se3.from_rotation_translation(so3.rotation_z(0.7), np.array([0.1, -0.2, 0.3]))
"""{S} in the base frame of an arm that does not stand at the origin."""

DEEP = -9.0
"""[m] Height of a table that limits nothing."""


def reachability(
    chain: Chain, *, table: float = DEEP, pitches: int = 5, rolls: int = 2
) -> Reachability:
    return Reachability(chain, STAND, table, pitches, rolls)


def inside(chain: Chain, count: int, seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(chain.lower, chain.upper, (count, chain.n))


def test_seven_axes_count_the_poses_that_a_posture_takes() -> None:
    """Some arm angles are tried only."""
    every = reachability(PANDA)
    solver = PoseSolver(kinematics_of(PANDA), every.clear)
    T = np.array([forward(PANDA, q) for q in inside(PANDA, 12, 1)])
    assert solver.taken(T).sum() >= 10


@pytest.mark.parametrize("chain", [UR5E, KR_6], ids=["UR5e", "KR 6"])
def test_count_is_that_of_poses_which_a_single_solution_takes(chain: Chain) -> None:
    narrow = dataclasses.replace(chain, lower=0.4 * chain.lower, upper=0.4 * chain.upper)
    every = reachability(narrow, pitches=6, rolls=3)
    points = [forward(narrow, q)[:3, 3] for q in inside(narrow, 4, 3)]
    solver, counted = kinematics_of(narrow), []
    for point in points:
        reached = 0
        for R in rotations(6, 3):
            T = se3.from_rotation_translation(STAND[:3, :3].T @ R, point)
            reached += any(
                solution.exact and solution.within_limits for solution in solver.inverse(T)
            )
        counted.append(reached)
    counts = every.count(in_base(every, np.array(points)))
    assert counts.tolist() == counted
    assert 0 < sum(counted) < 4 * 18


def test_points_out_of_reach_or_below_the_table_count_nothing() -> None:
    q = DrivenTool(UR5E).ready((), STAND)
    p = in_base(reachability(UR5E), forward(UR5E, q)[None, :3, 3])
    assert reachability(UR5E, pitches=24, rolls=4).count(p)[0] > 0
    height = float(p[0, 2])
    assert reachability(UR5E, table=height + 0.01).count(p).tolist() == [0]
    assert reachability(UR5E).count(p + 5.0).tolist() == [0]
    assert reachability(UR5E).count(np.empty((0, 3))).shape == (0,)


def test_axes_from_the_third_on_stay_above_the_table() -> None:
    every = reachability(UR5E, table=0.5)
    q = inside(UR5E, 200, 7)
    elbow = np.append(screws.point_on(UR5E.S[:, 2]), 1.0)
    heights = np.array([STAND[2] @ joint_frames(UR5E, posture)[1] @ elbow for posture in q])
    low = heights < 0.5
    assert 20 < low.sum() < len(q)
    clear = every.clear(q)
    assert not clear[low].any()
    assert 0 < clear.sum() < len(q)


def test_rotations_are_spread_evenly() -> None:
    R = rotations(40, 3)
    np.testing.assert_allclose(R @ R.swapaxes(1, 2) - np.eye(3), 0.0, atol=1e-12)
    z = R[::3, :, 2]
    assert np.linalg.norm(z.mean(axis=0)) < 0.02
    nearest = np.sort(np.arccos(np.clip(z @ z.T, -1.0, 1.0)), axis=1)[:, 1]
    assert nearest.min() > 0.5 * nearest.max()


def of_three_axes() -> Chain:
    chain = OPENMANIPULATOR_X
    return Chain(
        chain.M, chain.S[:, :3], chain.lower[:3], chain.upper[:3], chain.speed[:3], chain.names[:3]
    )


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "chain",
    [of_three_axes(), OPENMANIPULATOR_X, SKEWED_6],
    ids=["3 axes", "4 axes", "numerical"],
)
def test_other_arms_reach_the_voxels_of_their_postures(
    chain: Chain, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not LONG:
        monkeypatch.setattr(map_module, "SAMPLES", 3 * POSES)
    every = reachability(chain)
    size = every.reach / 7.0
    centers = every.reached(voxel_ranges(every.middle, every.reach, size, DEEP), size)
    points = in_base(every, np.array([forward(chain, q)[:3, 3] for q in inside(chain, 40, 8)]))
    apart = np.abs(points[:, None] - centers).max(axis=2).min(axis=1)
    assert apart.max() <= 0.5 * size + 1e-9
    assert np.linalg.norm(centers - every.middle, axis=1).max() <= every.reach + size


def test_map_that_would_take_too_long_is_refused_with_what_to_do() -> None:
    with pytest.raises(InputError, match=r"would take .*arm angle is set by axis 7.*larger voxels"):
        reachability_map(PANDA, STAND, voxel=0.01)
