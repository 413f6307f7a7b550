"""Sliding fingers, from the file to the objects that they hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yourdfpy

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.robot.collision import hand_of, world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.robot import Robot
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry import se3
from katana450.maths.kinematics.forward import forward
from katana450.settings import Settings
from tests.collision.distances import distances
from tests.robot.public_arms import PX150, urdf
from tests.ticks import rested

BOX = '<link name="{0}"><{1}><geometry><box size="{2}"/></geometry></{1}></link>'
THICK = 0.01
"""[m] Thickness of a finger along its direction of motion."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the file of a PincherX-150 with boxes for its fingers and its forearm."""
    text = urdf("arm", PX150)
    sizes = {"left": f"0.04 {THICK} 0.02", "right": f"0.04 {THICK} 0.02", "upper": "0.03 0.03 0.03"}
    for link, size in sizes.items():
        text = text.replace(f'<link name="{link}"/>', BOX.format(link, "collision", size))
    path = tmp_path / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def robot(path: Path) -> Robot:
    return load(path)


@pytest.fixture
def arm(robot: Robot) -> MountedArm:
    return robot.require_arm()


@pytest.fixture
def world(robot: Robot) -> CollisionWorld:
    world, _ = world_of(robot)
    assert world is not None
    return world


def test_bodies_of_fingers_slide(path: Path, arm: MountedArm, world: CollisionWorld) -> None:
    robot = yourdfpy.URDF.load(str(path), load_meshes=False)
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = rng.uniform(arm.chain.lower, arm.chain.upper)
        opened = float(rng.uniform(0.015, 0.037))
        robot.update_cfg(dict(zip(arm.chain.names, q, strict=True)) | {"left_finger": opened})
        T = world.linkage.poses(np.append(q, opened))
        for part in world.parts:
            expected = robot.get_transform(part.name)
            np.testing.assert_allclose(T[part.mover] @ part.T_mover_shape[0], expected, atol=1e-12)


def test_no_distance_changes_more_than_their_bodies_travel(
    robot: Robot, arm: MountedArm, world: CollisionWorld
) -> None:
    ball = se3.from_rotation_translation(np.eye(3), np.array([0.3, 0.0, 0.2]))
    scene_object = SceneObject("box", Shape.BOX, (0.02, 0.02, 0.02), ball, can_be_held=True)
    session = Session(arm, np.zeros(5), world, hand=hand_of(robot, world), objects=(scene_object,))
    around = session.world_at(session.begin(session.ready, 0.02, 0.0))
    assert around is not None
    pairs = np.arange(len(around.first))
    rng = np.random.default_rng(2)
    tightest = 0.0
    for _ in range(40):
        x = np.append(rng.uniform(-0.5, 0.5, 5), rng.uniform(0.015, 0.037))
        step = np.append(0.01 * rng.uniform(-1.0, 1.0, 5) * rng.integers(0, 2), 0.0)
        step[5] = rng.uniform(0.015, 0.037) - x[5]
        placed, moved = around.at(x), around.at(x + step)
        change = np.abs(distances(moved, pairs) - distances(placed, pairs))
        apart = distances(placed, pairs) > 0.0
        travel = around.travel(placed, x, x + step)
        assert (change <= travel + 2e-6)[apart].all()
        tightest = max(tightest, float((change / np.maximum(travel, 1e-6))[apart].max()))
    assert tightest > 0.5


def test_they_hold_and_release_an_object(
    robot: Robot, arm: MountedArm, world: CollisionWorld
) -> None:
    ready = arm.ready(Settings().ready)
    fingers = np.array([-0.027575, 0.0, 0.0])
    T = arm.T_base_shoulder @ forward(arm.chain, ready)
    T[:3, 3] += T[:3, :3] @ fingers
    width = 0.05
    scene_object = SceneObject("block", Shape.BOX, (0.02, width, 0.02), T, can_be_held=True)
    session = Session(arm, ready, world, hand=hand_of(robot, world), objects=(scene_object,))
    state = session.begin(ready, arm.gripper.upper, 0.0)
    state = rested(session, state, cmd.Gripper(arm.gripper.lower))
    (held,) = state.objects
    assert held.held
    inside = 0.5 * (width + THICK)
    assert state.gripper_setpoint == pytest.approx(inside, abs=1e-3)
    left = rested(session, state, cmd.Gripper(state.gripper_setpoint + 2e-3))
    assert not left.objects[0].held
