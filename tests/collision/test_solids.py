"""Poses of the moving groups and their convex bodies, against other readers and the raw solids."""

from __future__ import annotations

import functools

import numpy as np
import yourdfpy
from manifold3d import Manifold

from katana450.arm.robot.robot import Robot
from katana450.maths.collision.linkage import GROUND
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH
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
        posed = bare.at(x)
        pairs, _ = posed.nearer_than(1e-3 * LOOK)
        parts = {
            (int(bare.part_of[bare.first[pair]]), int(bare.part_of[bare.second[pair]]))
            for pair in pairs.tolist()
        }
        for a, b in parts:
            gap = placed(bare, a, T).min_gap(placed(bare, b, T), LOOK)
            assert gap >= 1e3 * contact.distance - ROUNDING


def test_poses_agree_with_the_description(
    robot: Robot, bare: CollisionWorld, postures: FloatArray
) -> None:
    urdf = yourdfpy.URDF.load(str(URDF_PATH), load_meshes=False)
    for x in postures[:20]:
        urdf.update_cfg(robot.joint_values(x[:-1], float(x[-1])))
        T = bare.linkage.poses(x)
        for part in bare.parts:
            expected = urdf.get_transform(part.name, "base_link")
            np.testing.assert_allclose(T[part.mover] @ part.T_mover_shape[0], expected, atol=1e-12)


def test_variables_between_two_groups(bare: CollisionWorld) -> None:
    mover = {part.name: part.mover for part in bare.parts}

    def between(a: str, b: str) -> frozenset[int]:
        return bare.linkage.variables_between(mover[a], mover[b])

    assert mover["base_link"] == mover["arm_base_link"] == GROUND
    assert between("base_link", "arm_base_link") == frozenset()
    assert between("pan_link", "wrist_link") == {1, 2, 3}
    assert between("wrist_link", "pan_link") == {1, 2, 3}
    assert between("roll_link", "gripper_link") == frozenset()
    # One slider drives both fingers.
    assert between("finger_left_link", "finger_right_link") == {5}
