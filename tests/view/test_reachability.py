"""A map of reachability in the scene: all points, or those of a cut."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import viser

from katana450.extensions.reachability.reachability_file import StoredMap
from katana450.extensions.reachability.view import Cut, ReachabilityCloud
from tests.viser_bridge import internals

POINTS = np.array([[0.3, y, 0.2] for y in (-0.1, 0.02, 0.1, 0.2)])


@pytest.mark.parametrize(
    ("cut", "shown"),
    [(Cut.WHOLE, [0, 1, 2, 3]), (Cut.HALF, [1, 2, 3]), (Cut.SLICE, [1])],
)
def test_points_of_a_cut_are_drawn(server: viser.ViserServer, cut: Cut, shown: list[int]) -> None:
    stored = StoredMap(POINTS, np.full(4, 0.5), 0.05, 0.0, "ur5e", "tool0")
    cloud = ReachabilityCloud(server, stored, 0.0)
    assert "50 % of all orientations" in cloud.legend
    cloud.show(cut)
    node: Any = internals.nodes(server)["/reachability"]
    np.testing.assert_allclose(node.points, POINTS[shown], atol=1e-3)
