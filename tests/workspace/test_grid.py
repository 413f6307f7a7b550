"""Tests of the voxel grid: every voxel that may have a reachable point is visited once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.extensions.reachability.map import VoxelGrid

CENTER = (0.01, -0.02, 0.3)
REACH = 0.25


@pytest.fixture(scope="module")
def grid() -> VoxelGrid:
    return VoxelGrid.around(CENTER, REACH, 0.04, table=0.1)


def test_every_point_of_the_ball_above_the_table_is_in_a_voxel(grid: VoxelGrid) -> None:
    centers = grid.centers(range(len(grid)))
    rng = np.random.default_rng(1)
    for _ in range(200):
        direction = rng.normal(size=3)
        point = CENTER + REACH * rng.uniform() * direction / np.linalg.norm(direction)
        # The lowest layer begins within half a voxel of the table.
        if point[2] >= 0.1 + 0.5 * grid.size:
            gap = np.abs(centers - point).max(axis=1)
            assert gap.min() <= 0.5 * grid.size + 1e-12


def test_no_voxel_is_below_the_table_and_none_is_missing(grid: VoxelGrid) -> None:
    heights = np.unique(grid.centers(range(len(grid)))[:, 2])
    assert heights[0] >= 0.1
    assert heights[0] - grid.size < 0.1
    assert np.allclose(np.diff(heights), grid.size)


def test_corners_are_multiples_of_the_edge_for_any_place_of_the_arm(grid: VoxelGrid) -> None:
    corners = grid.centers(range(len(grid))) / grid.size - 0.5
    assert np.allclose(corners, np.rint(corners), atol=1e-9)


@pytest.mark.parametrize("size", [0.0, -0.01, 1e-4, 1.0, math.nan, math.inf])
def test_an_invalid_voxel_is_refused(size: float) -> None:
    with pytest.raises(InputError, match="it must be from 1 to 250 mm"):
        VoxelGrid.around(CENTER, REACH, size, table=0.0)


@pytest.mark.parametrize("table", [0.55, 2.0, math.nan, math.inf, -math.inf])
def test_a_table_above_the_reach_is_refused(table: float) -> None:
    with pytest.raises(InputError, match="reaches up to 550 mm"):
        VoxelGrid.around(CENTER, REACH, 0.04, table)


def test_a_table_just_below_the_top_leaves_one_layer() -> None:
    grid = VoxelGrid.around(CENTER, REACH, 0.04, table=0.549)
    assert grid.shape[2] == 1
    assert (grid.centers(range(len(grid)))[:, 2] >= 0.549).all()
