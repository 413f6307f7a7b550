"""The robot's own collision world, alone and on its table."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.robot import Robot
from katana450.maths.collision.shape import half_space
from katana450.maths.collision.world import CollisionWorld, obstacle
from katana450.maths.geometry.arrays import FloatArray


@pytest.fixture(scope="module")
def bare(robot: Robot) -> CollisionWorld:
    """The arm without an environment."""
    world, notes = world_of(robot)
    assert world is not None
    assert notes == ()
    return world


@pytest.fixture(scope="module")
def world(bare: CollisionWorld) -> CollisionWorld:
    """The arm on its table."""
    return bare.with_obstacles([obstacle("table", np.eye(4), half_space())])


@pytest.fixture(scope="session")
def limits(arm: MountedArm) -> tuple[FloatArray, FloatArray]:
    """Lower and upper limits (6,) [rad] of the joints and the fingers."""
    chain, gripper = arm.chain, arm.gripper
    return np.append(chain.lower, gripper.lower), np.append(chain.upper, gripper.upper)


@pytest.fixture
def postures(limits: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Random postures (200, 6) [rad]."""
    return np.random.default_rng(7).uniform(*limits, (200, 6))
