"""The URDF becomes a chain: screw axes, home configuration and limits come only from the file."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.loader import load
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.errors import RobotDescriptionError
from katana450.resources import URDF_PATH
from tests.robot.urdf_files import edited

KATANA = URDF_PATH.read_text(encoding="utf-8")


def test_the_axes_are_the_papers(arm: MountedArm) -> None:
    S = arm.chain.S
    assert np.allclose(S[:3].T, [[0, 0, 1], [0, 1, 0], [0, 1, 0], [0, 1, 0], [1, 0, 0]], atol=1e-12)
    assert arm.chain.names == tuple(f"axis_{i}" for i in range(1, 6))


@pytest.mark.parametrize(
    ("tool", "reach"), [("tcp", 0.6318), ("flange", 0.5173), ("grasp", 0.5978)]
)
def test_home_configurations_are_the_papers(arm: MountedArm, tool: str, reach: float) -> None:
    M = arm.tools[tool]
    assert np.allclose(M[:3, :3], np.eye(3), atol=1e-12)
    assert np.allclose(M[:3, 3], [reach, 0.0, 0.0], atol=1e-9)


def test_limits_and_speeds_are_the_manufacturers(arm: MountedArm) -> None:
    chain = arm.chain
    lower = [-173.35, -124.25, -117.70, -116.50, -164.50]
    upper = [165.65, 7.75, 127.30, 107.50, 171.50]
    assert np.allclose(np.degrees(chain.lower), lower, atol=1e-9)
    assert np.allclose(np.degrees(chain.upper), upper, atol=1e-9)
    assert np.allclose(chain.speed, [2.209, 1.191, 1.191, 2.209, 2.209], atol=5e-4)


def test_the_shoulder_frame_stands_where_axes_1_and_2_cross(arm: MountedArm) -> None:
    assert np.allclose(arm.T_base_shoulder[:3, :3], np.eye(3))
    assert np.allclose(arm.T_base_shoulder[:3, 3], [0.0, 0.0, 0.2745])


def test_both_fingers_follow_one_joint(robot: Robot, arm: MountedArm) -> None:
    angles = robot.joint_values(np.zeros(5), 0.2)
    fingers = {name: angle for name, angle in angles.items() if name.startswith("finger")}
    assert len(fingers) == 2
    assert all(abs(angle) == 0.2 for angle in fingers.values())
    assert arm.gripper.lower == pytest.approx(-0.44)
    assert arm.gripper.upper == pytest.approx(0.30)


def test_every_mesh_is_there(robot: Robot) -> None:
    meshes = [visual.glb for body in robot.links for visual in body.visuals]
    assert len(meshes) == 10
    assert all(mesh is not None and mesh.read_bytes()[:4] == b"glTF" for mesh in meshes)
    assert robot.notes == robot.require_arm().notes == ()


def test_the_kinematics_follow_the_file(tmp_path: Path) -> None:
    """Check that a longer arm in the file is a longer arm: no number is duplicated."""
    changed = load(edited(tmp_path, KATANA, 'xyz="0.190', 'xyz="0.290')).require_arm()
    assert changed.tools["tcp"][0, 3] == pytest.approx(0.7318)
    assert math.isclose(changed.chain.S[5, 2], 0.290)  # v of axis 3: -omega x r


def test_a_finger_that_mimics_nothing_is_driven_with_the_other(tmp_path: Path) -> None:
    other = load(
        edited(tmp_path, KATANA, '<mimic joint="finger_right_joint"', '<dynamics friction="0"')
    )
    angles = other.joint_values(np.zeros(5), 0.2)
    assert (angles["finger_right_joint"], angles["finger_left_joint"]) == (0.2, 0.2)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(RobotDescriptionError, match=r"nowhere\.urdf"):
        load(tmp_path / "nowhere.urdf")
