"""The nearest pose against searches without closed forms."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.projection import project
from tests.kinematics.brute_force import NearestPoint, least_rotation
from tests.kinematics.targets import FRONT_UP, assert_on_branch, targets


def assert_no_search_beats_it(
    chain: Chain, lengths: FloatArray, poses: list[FloatArray], branch: Branch | None
) -> None:
    search = NearestPoint(chain, lengths, steps=15)
    inexact = 0
    for i, T in enumerate(poses):
        p = project(chain, T, branch=branch)
        assert_on_branch(p)
        if p.position_error > 1e-9:
            inexact += 1
            assert p.position_error <= search.distance(T[:3, 3], branch, seed=i) + 1e-6
        facing = math.atan2(p.T[1, 3], p.T[0, 3])
        theta1s = np.array([p.q[0], facing, facing - math.pi, facing + math.pi])
        theta1s = theta1s[(theta1s >= chain.lower[0]) & (theta1s <= chain.upper[0])]
        least = least_rotation(chain, lengths, T, p.T[:3, 3], branch, theta1s)
        assert p.rotation_error <= least + 1e-4
    assert 0 < inexact < len(poses)


def test_no_search_beats_it(chain: Chain, lengths: FloatArray) -> None:
    poses = targets(chain, np.random.default_rng(5), 5)
    assert_no_search_beats_it(chain, lengths, poses, None)


@pytest.mark.cases(2)
@pytest.mark.parametrize("branch", BRANCHES, ids=str)
def test_no_search_on_its_branch_beats_it(
    chain: Chain, lengths: FloatArray, branch: Branch
) -> None:
    poses = targets(chain, np.random.default_rng(6), 1)
    assert_no_search_beats_it(chain, lengths, poses, branch)


# Limits so narrow that axis 1 cannot face every target, or the wrist cannot straighten, or the tool
# can only fold back over the arm.
NARROW = (
    ([-0.5, -2.6, -0.9, 0.5, -1.0], [0.6, 0.1, 1.2, 1.8, 1.0]),
    ([-2.0, -2.6, -0.4, 2.0, -1.0], [2.0, 0.1, 0.3, 3.3, 1.0]),
    ([-0.5, -1.4, -0.9, -1.0, -0.4], [0.6, 0.1, 1.2, 0.8, 0.3]),
    ([-0.4, -2.6, -3.1, -2.8, -1.0], [0.3, -0.9, 3.1, 2.9, 0.2]),
)


@pytest.mark.cases(2)
@pytest.mark.parametrize(("lower", "upper"), NARROW)
@pytest.mark.parametrize("branch", [None, FRONT_UP])
def test_no_search_within_narrow_limits_beats_it(
    chain: Chain,
    lengths: FloatArray,
    lower: list[float],
    upper: list[float],
    branch: Branch | None,
) -> None:
    narrow = dataclasses.replace(chain, lower=np.array(lower), upper=np.array(upper))
    poses = targets(narrow, np.random.default_rng(7), 2)
    assert_no_search_beats_it(narrow, lengths, poses, branch)
