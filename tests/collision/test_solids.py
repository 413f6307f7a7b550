"""The convex bodies against the raw solids that they stand for."""

from __future__ import annotations

import functools

import numpy as np
from manifold3d import Manifold

from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from robot_description.cad.build import PARTS
from robot_description.cad.hulls import whole

ROUNDING = 1e-3  # mm
LOOK = 30.0  # mm


@functools.cache
def solid(link: str) -> Manifold:
    """Return the solid of ``link``, in mm."""
    return whole(next(make() for make in PARTS if make.__name__ == link))


def placed(world: CollisionWorld, number: int, T_base_mover: FloatArray) -> Manifold:
    part = world.parts[number]
    T = T_base_mover[part.mover] @ part.T_mover_shape[0]
    T[:3, 3] *= 1e3
    return solid(part.name).transform(T[:3])


def test_no_solids_touch_where_the_bodies_are_clear(
    bare: CollisionWorld, limits: tuple[FloatArray, FloatArray]
) -> None:
    rng = np.random.default_rng(11)
    looked_at = 0
    while looked_at < 40:
        x = rng.uniform(*limits)
        contact = bare.nearest(x)
        assert contact is not None
        if not 0.0 < contact.distance < 1e-3 * LOOK:
            continue
        looked_at += 1
        T = bare.linkage.poses(x)
        here = bare.at(x)
        pairs, _ = here.nearer_than(1e-3 * LOOK)
        parts = {
            (int(bare.part_of[bare.first[pair]]), int(bare.part_of[bare.second[pair]]))
            for pair in pairs.tolist()
        }
        for a, b in parts:
            gap = placed(bare, a, T).min_gap(placed(bare, b, T), LOOK)
            assert gap >= 1e3 * contact.distance - ROUNDING
