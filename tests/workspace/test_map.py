"""Tests of a whole map of the five-axis arm."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.extensions.reachability import reachability as map_module
from katana450.extensions.reachability.reachability import FAMILY, Reachability, reachability_map


def test_map_has_the_counts_of_its_voxels_however_many_are_counted_at_once(
    arm: MountedArm, monkeypatch: pytest.MonkeyPatch
) -> None:
    chain, T = arm.chain, arm.T_base_shoulder
    whole = reachability_map(chain, T, voxel=0.2)
    assert len(whole.points) > 50
    every = Reachability(chain, T, 0.0, FAMILY.pitches, FAMILY.rolls)
    counts = every.count(whole.points)
    np.testing.assert_array_equal(whole.fraction, counts / every.orientations.number)
    assert (whole.points[:, 2] >= 0.0).all()
    monkeypatch.setattr(map_module, "POSES", 300)
    pieces = reachability_map(chain, T, voxel=0.2)
    np.testing.assert_array_equal(whole.points, pieces.points)
    np.testing.assert_array_equal(whole.fraction, pieces.fraction)
