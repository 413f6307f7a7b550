"""The benchmark of other arms describes them rightly and measures what it says, without a peer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks import kinematics_report as report
from benchmarks.kinematics import OWN
from benchmarks.kinematics_arms import (
    CLOSED,
    KR_6,
    NUMERICAL,
    PANDA,
    UR5E,
    UR5E_FILE,
    ArmData,
    measured,
    random_postures,
    singular_postures,
)
from benchmarks.kinematics_own import chain_of
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.links import links_of
from katana450.maths.kinematics.chain import Chain
from tests.general_arms import published_arms

NOWHERE = Path("/nowhere")


def link_lengths(chain: Chain) -> list[float]:
    """Return the distances between consecutive axes, and along them, which no frame changes."""
    links = links_of(chain)
    return [*links.a, *np.abs(links.d).tolist()]


@pytest.mark.parametrize(
    ("arm", "published"),
    [
        (UR5E, published_arms.UR5E),
        (UR5E_FILE, published_arms.UR5E_FILE),
        (KR_6, published_arms.KR_6),
        (PANDA, published_arms.PANDA),
    ],
)
def test_arms_have_their_published_dimensions(arm: ArmData, published: Chain) -> None:
    chain = chain_of(arm.task(random_postures(1)))
    np.testing.assert_allclose(link_lengths(chain), link_lengths(published), atol=1e-12)
    assert kinematics_of(chain).method == kinematics_of(published).method


def test_closed_form_and_search_solve_the_poses() -> None:
    entries = [solver for solver in (*CLOSED, *NUMERICAL) if solver.peer is None]
    rows = measured(UR5E, entries, UR5E.task(random_postures(12)), 2, NOWHERE)
    assert [row.failed for row in rows] == ["", ""]
    for row in rows:
        assert row.quality is not None
        assert row.quality.solved == row.quality.usable == 1.0
    assert rows[0].quality is not None
    assert 4.0 < rows[0].quality.branches <= 8.0
    assert rows[0].quality.worst < 1e-12
    assert rows[0].ratios.tolist() == [1.0, 1.0]
    assert len(list(report.single_table(rows))) == 4


@pytest.mark.long
def test_singular_task_is_singular_and_solved() -> None:
    task = UR5E.task(singular_postures(30, UR5E.elbow))
    (row,) = measured(UR5E, [CLOSED[0]], task, 1, NOWHERE)
    assert CLOSED[0].name == OWN
    assert row.quality is not None
    assert row.quality.solved == 1.0
