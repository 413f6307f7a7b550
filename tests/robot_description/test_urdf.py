"""The URDF as a reader sees it: frames, axes, limits, inertials, meshes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import yourdfpy
from numpy.typing import NDArray

from katana450.resources import URDF_PATH

AXES = ("axis_1", "axis_2", "axis_3", "axis_4", "axis_5")
ARM_MASS = 4.80  # kg, without the control box


@pytest.fixture(scope="module")
def robot() -> yourdfpy.URDF:
    return yourdfpy.URDF.load(str(URDF_PATH), build_scene_graph=True, load_meshes=True)


def position(robot: yourdfpy.URDF, link: str, base: str = "base_link") -> NDArray[np.float64]:
    return np.asarray(robot.get_transform(link, base)[:3, 3], dtype=np.float64)


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


def test_wrist_to_tool_is_the_manufacturers(robot: yourdfpy.URDF) -> None:
    robot.update_cfg(np.zeros(6))
    wrist = position(robot, "wrist_link")
    assert position(robot, "tcp")[0] - wrist[0] == pytest.approx(0.1473 + 0.1555, abs=1e-12)
    assert position(robot, "flange")[0] - wrist[0] == pytest.approx(0.1473 + 0.041, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "axis", "lower", "upper", "speed"),
    [
        ("axis_1", (0, 0, 1), -173.35, 165.65, 2.208932),
        ("axis_2", (0, 1, 0), -124.25, 7.75, 1.190799),
        ("axis_3", (0, 1, 0), -117.70, 127.30, 1.190799),
        ("axis_4", (0, 1, 0), -116.50, 107.50, 2.208932),
        ("axis_5", (1, 0, 0), -164.50, 171.50, 2.208932),
    ],
)
def test_axis_and_limits(
    robot: yourdfpy.URDF,
    name: str,
    axis: tuple[int, int, int],
    lower: float,
    upper: float,
    speed: float,
) -> None:
    joint = robot.joint_map[name]
    assert joint.type == "revolute"
    assert tuple(joint.axis) == axis
    assert joint.limit.lower == pytest.approx(math.radians(lower), abs=1e-15)
    assert joint.limit.upper == pytest.approx(math.radians(upper), abs=1e-15)
    assert joint.limit.velocity == pytest.approx(speed, abs=1e-6)
    assert joint.limit.effort > 0.0


def test_pose_off_zero_turns_as_the_axes_say(robot: yourdfpy.URDF) -> None:
    robot.update_cfg(np.array([math.pi / 2, -math.pi / 2, 0.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(position(robot, "tcp"), (0.0, 0.0, 0.2745 + 0.6318), atol=1e-12)
    robot.update_cfg(np.array([math.pi / 2, 0.0, math.pi / 2, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(position(robot, "tcp"), (0.0, 0.190, 0.2745 - 0.4418), atol=1e-12)


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


def test_inertias_belong_to_real_bodies(robot: yourdfpy.URDF) -> None:
    for link in robot.robot.links:
        if link.inertial is None:
            continue
        tensor = np.asarray(link.inertial.inertia)
        np.testing.assert_array_equal(tensor, tensor.T)
        smallest, middle, largest = np.linalg.eigvalsh(tensor)
        assert smallest > 0.0, link.name
        assert smallest + middle > largest, link.name
