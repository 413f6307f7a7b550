"""The URDF as a reader sees it: frames, axes, limits, inertials, meshes."""

from __future__ import annotations

import numpy as np
import pytest
import yourdfpy

from katana450.resources import URDF_PATH

AXES = ("axis_1", "axis_2", "axis_3", "axis_4", "axis_5")
ARM_MASS = 4.80  # kg, without the control box


@pytest.fixture(scope="module")
def robot() -> yourdfpy.URDF:
    return yourdfpy.URDF.load(str(URDF_PATH), build_scene_graph=True, load_meshes=True)


def test_urdf_is_valid_and_every_mesh_is_found(robot: yourdfpy.URDF) -> None:
    assert robot.validate()
    names = [v.geometry.mesh.filename for link in robot.robot.links for v in link.visuals]
    assert len(names) == 10
    assert all(not name.startswith(("/", "package:", "file:")) for name in names)
    assert all((URDF_PATH.parent / name).is_file() for name in names)
    assert len(robot.scene.geometry) >= len(names)


def test_actuated_joints_are_the_five_axes_and_one_finger(robot: yourdfpy.URDF) -> None:
    assert tuple(robot.actuated_joint_names) == (*AXES, "finger_right_joint")


@pytest.mark.parametrize(
    ("link", "x", "z"),
    [
        ("arm_base_link", 0.0, 0.073),
        ("shoulder_frame", 0.0, 0.2745),
        ("upper_arm_link", 0.0, 0.2745),
        ("forearm_link", 0.190, 0.2745),
        ("wrist_link", 0.329, 0.2745),
        ("roll_link", 0.4813, 0.2745),
        ("gripper_link", 0.5136, 0.2745),
        ("flange", 0.5173, 0.2745),
        ("finger_left_link", 0.5476, 0.2745),
        ("grasp", 0.5978, 0.2745),
        ("tcp", 0.6318, 0.2745),
    ],
)
def test_frames_at_zero_are_parallel_and_in_place(
    robot: yourdfpy.URDF, link: str, x: float, z: float
) -> None:
    robot.update_cfg(np.zeros(6))
    pose = robot.get_transform(link, "base_link")
    np.testing.assert_allclose(pose[:3, 3], (x, 0.0, z), atol=1e-12)
    np.testing.assert_allclose(pose[:3, :3], np.eye(3), atol=1e-12)


def test_fingers_mirror_and_a_positive_angle_opens(robot: yourdfpy.URDF) -> None:
    left = robot.joint_map["finger_left_joint"]
    assert left.mimic.joint == "finger_right_joint"
    along = np.array([0.08, 0.0, 0.0, 1.0])
    heights = []
    for angle in (-0.44, 0.0, 0.30):
        robot.update_cfg(np.array([0.0, 0.0, 0.0, 0.0, 0.0, angle]))
        right = robot.get_transform("finger_right_link", "gripper_link") @ along
        mirrored = robot.get_transform("finger_left_link", "gripper_link") @ along
        np.testing.assert_allclose(mirrored[:3], right[:3] * (1.0, -1.0, 1.0), atol=1e-12)
        heights.append(right[1])
    assert heights[0] < heights[1] < heights[2]


def test_masses_add_up_to_the_weighed_arm(robot: yourdfpy.URDF) -> None:
    masses = {link.name: link.inertial.mass for link in robot.robot.links if link.inertial}
    assert len(masses) == 10
    assert sum(masses.values()) - masses["base_link"] == pytest.approx(ARM_MASS, abs=2e-3)
