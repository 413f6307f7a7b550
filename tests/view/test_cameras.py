"""All of the arm is in every picture, however it is posed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.robot.model import RobotModel
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.cameras import FOV, LOOKS, Preset

ASPECT = 1.2
"""Width to height of the scene in a window of 1280 by 800 beside the panel."""


@pytest.fixture(scope="module")
def postures(model: RobotModel) -> FloatArray:
    """(n, 5) [rad] at random, and stretched out to every side."""
    chain = model.arm.chain
    stretched = [
        (pan, shoulder, 0.0, 0.0, 0.0)
        for pan in np.linspace(chain.lower[0], chain.upper[0], 12)
        for shoulder in np.linspace(chain.lower[1], chain.upper[1], 7)
    ]
    random = np.random.default_rng(450).uniform(chain.lower, chain.upper, (40, 5))
    return np.concatenate((stretched, random))


def points_on(model: RobotModel, q: FloatArray) -> FloatArray:
    """Points (n, 3) [m] on the arm's hulls in the base frame, the fingers wide open."""
    angles = model.joint_angles(q, model.arm.gripper.upper)
    T: dict[str, FloatArray] = {}
    points = []
    for body in model.bodies:
        above = np.eye(4) if body.parent is None else T[body.parent]
        T[body.name] = above @ body.T_parent_body
        if body.joint is not None:
            T[body.name][:3, :3] @= so3.exp(body.axis * angles[body.joint])
        R, p = T[body.name][:3, :3], T[body.name][:3, 3]
        points += [shape.mesh.vertices @ R.T + p for shape in body.collisions]
    return np.concatenate(points)


@pytest.mark.parametrize("preset", LOOKS)
def test_no_pose_is_cut_off(model: RobotModel, postures: FloatArray, preset: Preset) -> None:
    look = LOOKS[preset]
    position, target = np.array(look.position), np.array(look.target)
    ahead = (target - position) / np.linalg.norm(target - position)
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    top = math.tan(0.5 * FOV)
    greatest = 0.0
    for q in postures:
        points = points_on(model, q)
        if points[:, 2].min() < -0.02:
            continue  # through the table
        seen = points - position
        depth = seen @ ahead
        across = np.abs(seen @ right / depth).max() / (ASPECT * top)
        up = np.abs(seen @ np.cross(right, ahead) / depth).max() / top
        greatest = max(greatest, across, up)
    # And it fills the picture.
    assert 0.9 < greatest < 1.0
