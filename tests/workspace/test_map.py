"""Tests of a whole map: it is the same for any chunks in any order."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.robot.mounted_arm import MountedArm
from katana450.extensions.reachability import map as map_module
from katana450.extensions.reachability.map import Survey
from katana450.extensions.reachability.reachability import Reachability
from katana450.extensions.reachability.view import fraction_colors


@pytest.fixture(scope="module")
def survey(arm: MountedArm) -> Survey:
    reachability = Reachability(arm.chain, arm.T_base_shoulder, 0.0, 3, 4)
    return Survey(reachability, voxel=0.16)


def test_a_map_has_the_counts_of_its_voxels(survey: Survey) -> None:
    found = survey.map(survey.count(chunk) for chunk in survey.chunks())
    assert len(found.points) > 50
    assert np.array_equal(found.fraction * 12, survey.reachability.count(found.points))
    assert (found.fraction > 0.0).all()
    assert (found.fraction <= 1.0).all()
    assert (found.points[:, 2] >= 0.0).all()


def test_chunks_do_not_change_the_map(survey: Survey, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = survey.map(survey.count(chunk) for chunk in survey.chunks())
    monkeypatch.setattr(map_module, "POSES", 300)
    chunks = survey.chunks()
    assert len(chunks) > 3
    counts = {number: survey.count(chunks[number]) for number in reversed(range(len(chunks)))}
    pieces = survey.map(counts[number] for number in range(len(chunks)))
    assert np.array_equal(whole.points, pieces.points)
    assert np.array_equal(whole.fraction, pieces.fraction)


def test_colours_grow_lighter_with_the_fraction() -> None:
    colors = fraction_colors(np.array([0.0, 0.1, 0.2, 0.3])).astype(int)
    assert (np.diff(colors.sum(axis=1)) > 0).all()
    assert np.array_equal(colors, fraction_colors(2.0 * np.array([0.0, 0.1, 0.2, 0.3])))
    assert fraction_colors(np.empty(0)).shape == (0, 3)
