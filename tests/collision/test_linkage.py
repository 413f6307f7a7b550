"""Poses of the moving groups, against another reader of the same file."""

from __future__ import annotations

import numpy as np
import yourdfpy

from katana450.arm.robot.robot import Robot
from katana450.maths.collision.linkage import GROUND
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.resources import URDF_PATH


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
