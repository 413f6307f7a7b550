"""The whole arm is in the picture of every camera, in every posture."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import find_robot
from katana450.maths.geometry import screws
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward, joint_frames
from katana450.resources import URDF_PATH
from katana450.server.view.cameras import camera_pose, initial_camera
from katana450.server.viser_bridge.presets import CAMERA_POSES, FOV, Preset
from katana450.settings import Settings
from tests.general_arms.links_of_arms import ur5e
from tests.robot.test_other_arms import PINCHER, YOUBOT

ASPECT = 1.2
"""Width to height of the scene in a window of 1280 by 800 beside the panel."""


@pytest.fixture(scope="module")
def postures(arm: MountedArm) -> FloatArray:
    """Return random and stretched postures (n, 5) [rad]."""
    chain = arm.chain
    stretched = [
        (pan, shoulder, 0.0, 0.0, 0.0)
        for pan in np.linspace(chain.lower[0], chain.upper[0], 12)
        for shoulder in np.linspace(chain.lower[1], chain.upper[1], 7)
    ]
    random = np.random.default_rng(450).uniform(chain.lower, chain.upper, (40, 5))
    return np.concatenate((stretched, random))


def points_on(robot: Robot, q: FloatArray) -> FloatArray:
    """Return points (n, 3) [m] on the arm's hulls in the base frame, with open fingers."""
    T = robot.frames(robot.joint_values(q, robot.require_arm().gripper.upper))
    points = []
    for link in robot.links:
        R, p = T[link.name][:3, :3], T[link.name][:3, 3]
        points += [shape.mesh.vertices @ R.T + p for shape in link.collisions]
    return np.concatenate(points)


def test_smaller_arm_of_five_axes_is_seen_from_nearer(robot: Robot) -> None:
    assert initial_camera(robot) is None
    described, _, _ = find_robot(Settings(), PINCHER, None)
    look = initial_camera(described)
    assert described.require_arm().kinematics.is_pitched
    assert look is not None
    whole = CAMERA_POSES[Preset.FREE]
    distance = float(np.linalg.norm(look.eye - look.target))
    assert distance < 0.8 * math.dist(whole.position, whole.target)


@pytest.mark.parametrize("name", ["katana", "YouBot", "UR5e"])
def test_camera_on_the_tool_is_behind_it(name: str, tmp_path: Path) -> None:
    """The tool of a UR5e points along z of its frame, that of a YouBot against it."""
    path = {"katana": URDF_PATH, "YouBot": YOUBOT, "UR5e": tmp_path / "ur5e.urdf"}[name]
    if name == "UR5e":
        path.write_text(ur5e(), encoding="utf-8")
    robot, session, _ = find_robot(Settings(), path, None)
    state, arm = session.begin(session.ready, 0.0, 0.0), robot.require_arm()
    T = arm.T_base_shoulder @ forward(arm.chain_to(state.tool), state.q)
    wrist = arm.T_base_shoulder @ joint_frames(arm.chain, state.q)[-2]
    axis = wrist[:3, :3] @ arm.chain.S[:3, -2]
    out = T[:3, 3] - (wrist @ [*screws.point_on(arm.chain.S[:, -2]), 1.0])[:3]
    out -= (out @ axis) * axis
    pose = camera_pose(Preset.TOOL, robot, state)
    position, target = np.array(pose.position), np.array(pose.target)
    assert (target - T[:3, 3]) @ out > 0.8 * np.linalg.norm(target - T[:3, 3]) * np.linalg.norm(out)
    assert (position - T[:3, 3]) @ out < 0.0
    assert position[2] > T[2, 3]


@pytest.mark.parametrize("preset", CAMERA_POSES)
def test_no_posture_is_cut_off(robot: Robot, postures: FloatArray, preset: Preset) -> None:
    look = CAMERA_POSES[preset]
    position, target = np.array(look.position), np.array(look.target)
    axis = (target - position) / np.linalg.norm(target - position)
    right = np.cross(axis, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    top = math.tan(0.5 * FOV)
    greatest = 0.0
    for q in postures:
        points = points_on(robot, q)
        if points[:, 2].min() < -0.02:
            continue  # through the table
        rays = points - position
        depth = rays @ axis
        across = np.abs(rays @ right / depth).max() / (ASPECT * top)
        up = np.abs(rays @ np.cross(right, axis) / depth).max() / top
        greatest = max(greatest, across, up)
    # The arm also fills the picture.
    assert 0.9 < greatest < 1.0
