"""The raw solids in motion: no link intersects its neighbour at any joint angle."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from tests.robot_description.solids import robot, solid

AXES = ("axis_1", "axis_2", "axis_3", "axis_4", "axis_5")
SAMPLES = 9
AIR = 0.2  # mm that two links which turn in each other keep between them
ROUNDING = 1e-6  # mm3


def pair(name: str, angle: float) -> tuple[Manifold, Manifold]:
    """Return the links on both sides of a joint at ``angle`` [rad]."""
    joint = robot().joint_map[name]
    offset = np.zeros(3) if joint.origin is None else joint.origin[:3, 3] * 1e3
    turned = solid(joint.child).rotate(tuple(np.degrees(angle) * np.asarray(joint.axis)))
    return solid(joint.parent), turned.translate(tuple(offset))


@pytest.mark.parametrize("name", AXES)
def test_neighbours_keep_apart_over_the_joint_range(name: str) -> None:
    limit = robot().joint_map[name].limit
    for angle in np.linspace(limit.lower, limit.upper, SAMPLES):
        parent, child = pair(name, angle)
        common = parent ^ child
        assert common.volume() < ROUNDING, (
            f"{name} at {np.degrees(angle):.1f} degrees: {common.volume():.2f} mm3 of both links "
            f"in {np.round(common.bounding_box(), 1)}"
        )


@pytest.mark.parametrize("name", ["axis_2", "axis_3", "axis_4"])
def test_forks_have_air_around_the_parts_that_turn_in_them(name: str) -> None:
    limit = robot().joint_map[name].limit
    for angle in (limit.lower, limit.upper):
        parent, child = pair(name, angle)
        assert parent.min_gap(child, 1.0) >= AIR


def test_a_link_out_of_place_by_two_millimetres_is_noticed() -> None:
    parent, child = pair("axis_3", 0.0)
    assert (parent ^ child.translate((0.0, 2.0, 0.0))).volume() > ROUNDING
