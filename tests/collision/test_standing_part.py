"""A part that stands on the table and turns there costs a plan hardly any postures."""

from __future__ import annotations

import math

import numpy as np

from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import box, half_space
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.clearance import SweptClearance

MAX_POSTURES = 64
"""[1] While the turn counted as motion of the part, both searches needed 32,766 postures."""


def test_turn_of_a_part_on_the_table_is_decided_in_few_postures() -> None:
    turning = RigidGroup(0, np.eye(4), np.array([0.0, 0.0, 1.0]), 0)
    middle = se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, 0.1]))
    part = Part("turntable", 1, (middle,), (box((0.3, 0.3, 0.2)),))
    world = CollisionWorld(Linkage([turning]), [part], []).with_obstacles(
        [obstacle("table", np.eye(4), half_space())]
    )
    start, end = np.array([0.0, 0.0]), np.array([math.pi, 0.0])
    asked = 0

    def at(sigma: float) -> FloatArray:
        nonlocal asked
        asked += 1
        return np.asarray(start + sigma * (end - start))

    def turned(low: float, high: float) -> FloatArray:
        return np.asarray((high - low) * (end - start))

    room = SweptClearance.about(world, 0.006, start, end)
    assert room.blocked(at, turned) is None
    nearest = room.nearest(at, turned)
    assert nearest is not None
    assert abs(nearest.contact.distance) < 1e-6
    assert asked <= MAX_POSTURES
