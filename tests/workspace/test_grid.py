"""Tests of the voxel grid: every voxel that may have a reachable point is visited once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.reachability.reachability import voxel_centers, voxel_ranges
from katana450.maths.geometry.arrays import FloatArray

CENTER = (0.01, -0.02, 0.3)
REACH = 0.25


SIZE = 0.04


@pytest.fixture(scope="module")
def centers() -> FloatArray:
    return voxel_centers(voxel_ranges(CENTER, REACH, SIZE, table=0.1), SIZE)


def test_every_point_of_the_ball_above_the_table_is_in_a_voxel(centers: FloatArray) -> None:
    rng = np.random.default_rng(1)
    for _ in range(200):
        direction = rng.normal(size=3)
        point = CENTER + REACH * rng.uniform() * direction / np.linalg.norm(direction)
        # The lowest layer begins within half a voxel of the table.
        if point[2] >= 0.1 + 0.5 * SIZE:
            gap = np.abs(centers - point).max(axis=1)
            assert gap.min() <= 0.5 * SIZE + 1e-12


def test_no_voxel_is_below_the_table_and_none_is_missing(centers: FloatArray) -> None:
    heights = np.unique(centers[:, 2])
    assert heights[0] >= 0.1
    assert heights[0] - SIZE < 0.1
    assert np.allclose(np.diff(heights), SIZE)
    assert len(np.unique(centers, axis=0)) == len(centers)


def test_corners_are_multiples_of_the_edge_for_any_place_of_the_arm(centers: FloatArray) -> None:
    corners = centers / SIZE - 0.5
    assert np.allclose(corners, np.rint(corners), atol=1e-9)


@pytest.mark.parametrize("size", [0.0, -0.01, 1e-4, 1.0, math.nan, math.inf])
def test_an_invalid_voxel_is_refused(size: float) -> None:
    with pytest.raises(InputError, match="it must be from 1 to 250 mm"):
        voxel_ranges(CENTER, REACH, size, table=0.0)


@pytest.mark.parametrize("table", [0.55, 2.0, math.nan, math.inf, -math.inf])
def test_a_table_above_the_reach_is_refused(table: float) -> None:
    with pytest.raises(InputError, match="reaches up to 550 mm"):
        voxel_ranges(CENTER, REACH, SIZE, table)


def test_a_table_just_below_the_top_leaves_one_layer() -> None:
    ranges = voxel_ranges(CENTER, REACH, SIZE, table=0.549)
    assert len(ranges[2]) == 1
    assert (voxel_centers(ranges, SIZE)[:, 2] >= 0.549).all()
