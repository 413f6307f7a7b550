"""The kinematics benchmark measures the advertised quantities; the tests need no peer."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from benchmarks.kinematics import ROOT, measure, seeded_task
from benchmarks.kinematics_own import Floor
from benchmarks.kinematics_quality import quality
from benchmarks.kinematics_report import Tables
from benchmarks.kinematics_task import SOLVED_POSITION
from katana450.maths.kinematics.solver import inverse

POSES = 12

needs_compiler = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


@pytest.fixture(scope="module")
def tables() -> Tables:
    """Return the tables of a short run without peers."""
    return measure(POSES, 2, 1, ROOT / "nowhere", ["katana450", "floor"])


def test_the_app_solves_every_pose_with_every_branch(tables: Tables) -> None:
    (row,) = tables.one_by_one
    assert row.failed == ""
    assert row.quality is not None
    assert row.quality.solved == row.quality.usable == 1.0
    assert row.quality.branches == 4.0
    assert 1.0 <= row.quality.inside <= 4.0
    assert row.quality.worst < 1e-12
    assert row.microseconds.shape == (2,)
    assert (row.microseconds > 0.0).all()
    assert row.ratios.tolist() == [1.0, 1.0]


@needs_compiler
def test_the_same_form_in_c_gives_the_same_angles() -> None:
    chain, task = seeded_task(200, 3)
    floor = Floor(task)
    for T, q in zip(task.T, floor.joints_batch(floor.solve_batch(task.T)), strict=True):
        expected = np.array([solution.q for solution in inverse(chain, T)])
        assert np.allclose(q, expected, rtol=0.0, atol=1e-7)


def test_wrong_answers_and_doubles_do_not_count() -> None:
    chain, task = seeded_task(1, 2)
    right = inverse(chain, task.T[0])[0].q
    turned = right + np.array([2.0 * np.pi, 0.0, 0.0, 0.0, 0.0])
    wrong = right + np.array([0.0, 2.0 * SOLVED_POSITION, 0.0, 0.0, 2e-5])
    figures = quality(chain, task.T, [np.array([right, turned, wrong])])
    assert figures.branches == 1.0
    assert figures.worst > 1e-7
    missed = quality(chain, task.T, [np.array([wrong])])
    assert missed.solved == missed.branches == missed.usable == 0.0
    assert quality(chain, task.T, [np.empty((0, 5))]).solved == 0.0
