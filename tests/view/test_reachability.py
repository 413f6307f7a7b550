"""A map of reachability in the scene: all points, or those where the tool can be as at Home."""

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
    ("at_home", "cut", "shown"),
    [
        (False, Cut.WHOLE, [0, 1, 2, 3]),
        (True, Cut.WHOLE, [0, 2]),
        (True, Cut.HALF, [2]),
        (False, Cut.SLICE, [1]),
    ],
)
def test_points_of_a_cut_and_of_an_orientation_are_drawn(
    server: viser.ViserServer, at_home: bool, cut: Cut, shown: list[int]
) -> None:
    stored = StoredMap(
        POINTS, np.full(4, 0.5), 0.05, "ur5e", "tool0", np.array([True, False, True, False])
    )
    cloud = ReachabilityCloud(server, stored, 0.0)
    assert cloud.tells_home
    assert "50 % of all orientations" in cloud.legend
    cloud.show(cut, at_home=at_home)
    node: Any = internals.nodes(server)["/reachability"]
    np.testing.assert_allclose(node.points, POINTS[shown], atol=1e-3)


def test_map_of_five_axes_tells_no_orientation(server: viser.ViserServer) -> None:
    cloud = ReachabilityCloud(
        server, StoredMap(POINTS, np.full(4, 0.5), 0.05, "katana450", "tcp"), 0.0
    )
    assert not cloud.tells_home
    assert "pitches and rolls" in cloud.legend
    cloud.show(Cut.WHOLE, at_home=True)
    node: Any = internals.nodes(server)["/reachability"]
    assert len(node.points) == 4
