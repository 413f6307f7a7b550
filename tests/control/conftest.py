"""Fixtures of the session tests: the arm at rest, and a collision world with a cup."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session.session import Session
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import describe_robot
from katana450.maths.collision.shape import cylinder, half_space
from katana450.maths.collision.world import CollisionWorld, obstacle
from katana450.maths.geometry import se3
from katana450.resources import URDF_PATH
from katana450.settings import Settings


@pytest.fixture(scope="session")
def world(robot: Robot) -> CollisionWorld:
    """The arm on its table, with a cup in front of it."""
    bodies, _ = world_of(robot)
    assert bodies is not None
    cup_at = se3.from_rotation_translation(np.eye(3), (0.42, -0.10, 0.07))
    cup = obstacle("cup", cup_at, cylinder(0.035, 0.14))
    return bodies.with_obstacles([obstacle("table", np.eye(4), half_space()), cup])


@pytest.fixture(scope="session")
def guarded(arm: ArmModel, world: CollisionWorld) -> Session:
    """A session of the arm on its table, with the cup."""
    return Session(arm, np.array(Settings().ready), world)


@pytest.fixture(scope="session")
def shipped() -> Session:
    """The session of the app: the arm on its table, its objects and the water."""
    return describe_robot(Settings(), URDF_PATH, None).session
