"""The URDF becomes a chain: screw axes, home configuration and limits come only from the file."""

from __future__ import annotations

import json
import math
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from katana450.arm.robot.arm_reader import MountedArm
from katana450.arm.robot.collision import scene_objects_of, table, world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.props import BASIN_AT, CUP_AT, load_props
from katana450.arm.robot.robot import Robot, bare, loads_of
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.collision.world import obstacle
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import joint_frames
from katana450.maths.kinematics.statics import GRAVITY, LinkLoad, holding_torques
from katana450.resources import PROPS_PATH, URDF_PATH
from katana450.settings import Settings
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


def energy(robot: Robot, q: FloatArray) -> float:
    """Return the potential energy [J] of the weight, from the position of each mass."""
    moved = (np.eye(4), *joint_frames(robot.require_arm().chain, q))
    return sum(
        GRAVITY * load.mass * float((moved[load.axes] @ [*load.centre, 1.0])[2])
        for load in loads_of(robot)
    )


@pytest.mark.parametrize("seed", range(5))
def test_torques_are_the_slope_of_the_energy(robot: Robot, arm: MountedArm, seed: int) -> None:
    chain = arm.chain
    q = np.random.default_rng(seed).uniform(chain.lower, chain.upper)
    step = 1e-5
    slope = [
        (energy(robot, q + step * e) - energy(robot, q - step * e)) / (2.0 * step)
        for e in np.eye(chain.n)
    ]
    np.testing.assert_allclose(holding_torques(chain, q, loads_of(robot)), slope, rtol=0, atol=1e-8)


def test_mujoco_finds_the_same_from_the_file(robot: Robot, arm: MountedArm) -> None:
    peer = mujoco.MjModel.from_xml_path(str(URDF_PATH))
    peer.opt.gravity[:] = (0.0, 0.0, -GRAVITY)
    data = mujoco.MjData(peer)
    chain, random = arm.chain, np.random.default_rng(450)
    for _ in range(10):
        q = random.uniform(chain.lower, chain.upper)
        for name, angle in zip(chain.names, q, strict=True):
            data.joint(name).qpos[0] = angle
        mujoco.mj_forward(peer, data)
        wanted = [float(data.joint(name).qfrc_bias[0]) for name in chain.names]
        np.testing.assert_allclose(
            holding_torques(chain, q, loads_of(robot)), wanted, rtol=0, atol=1e-6
        )


def test_vertical_arm_needs_torque_for_the_gripper_only(robot: Robot, arm: MountedArm) -> None:
    chain = arm.chain
    upright = holding_torques(chain, np.deg2rad((30.0, -90.0, 0.0, 0.0, 0.0)), loads_of(robot))
    stretched = holding_torques(chain, np.zeros(chain.n), loads_of(robot))
    # Axis 1 is vertical. A shoulder that holds the arm out pulls up, towards negative angles.
    assert abs(stretched[0]) < 1e-12
    assert stretched[1] < -5.0
    assert abs(upright[1]) < 0.1 * abs(stretched[1])
    without = holding_torques(chain, np.zeros(chain.n), loads_of(bare(robot)))
    assert abs(without[1]) < abs(stretched[1]) - 0.5
    total = sum(load.mass for load in loads_of(robot) if load.axes)
    assert 0.0 < total < 4.8


def test_mass_of_the_base_needs_no_torque(robot: Robot, arm: MountedArm) -> None:
    chain = arm.chain
    base = LinkLoad(0, 100.0, np.array((1.0, 1.0, 1.0)))
    assert not holding_torques(chain, np.zeros(chain.n), [base]).any()
    with pytest.raises(InputError):
        holding_torques(chain, np.full(chain.n, np.nan), loads_of(robot))


def test_a_straight_vessel_is_as_wide_at_its_floor() -> None:
    props = load_props()
    assert props.cup.floor_radius == props.cup.inner_radius
    assert props.basin.floor_radius == 0.084 < props.basin.inner_radius


@pytest.mark.parametrize(
    ("prop", "change", "message"),
    [
        ("cup", {"height": -1.0}, r"> 0.0 - at `\$.cup.height`"),
        ("cup", {"outer_radius": 0.01}, "no thickness"),
        ("basin", {"mass": float("nan")}, "JSON is malformed"),
        ("basin", {"floor_radius": 0.0}, r"> 0.0 - at `\$.basin.floor_radius`"),
        ("basin", {"floor": "thick"}, "Expected `float`"),
        ("table", {"x": [1.0, 0.0]}, "not an interval"),
        ("table", {"mesh": "chair.glb"}, "no mesh"),
    ],
)
def test_invalid_props_are_refused(
    tmp_path: Path, prop: str, change: dict[str, object], message: str
) -> None:
    described = json.loads(PROPS_PATH.read_text(encoding="utf-8"))
    described[prop].update(change)
    for name in ("cup", "basin", "table"):
        (tmp_path / f"{name}.glb").touch()
    path = tmp_path / "props.json"
    path.write_text(json.dumps(described), encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=message):
        load_props(path)


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"cup": 3, "basin": 3, "table": 3}'])
def test_an_invalid_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "props.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RobotDescriptionError, match=r"props\.json"):
        load_props(path)
    with pytest.raises(RobotDescriptionError, match=r"none\.json"):
        load_props(tmp_path / "none.json")


def test_obstacles_enclose_the_props(robot: Robot, arm: MountedArm) -> None:
    """Check that no mesh of a prop leaves its collision shape, nor the table's top face."""
    props = load_props()
    cup, basin = (
        obstacle(scene_object.name, scene_object.T_collision_shape, scene_object.collision_shape)
        for scene_object in scene_objects_of(props)
    )
    for part, vessel, place in ((cup, props.cup, CUP_AT), (basin, props.basin, BASIN_AT)):
        points = np.asarray(trimesh.load_scene(vessel.mesh).to_mesh().vertices) + place
        (T,) = part.T_mover_shape
        local = (points - T[:3, 3]) @ T[:3, :3]
        (shape,) = part.shapes
        assert (local >= np.array(shape.low) - 2e-4).all()
        assert (local <= np.array(shape.high) + 2e-4).all()
        assert np.hypot(local[:, 0], local[:, 1]).max() <= vessel.outer_radius + 2e-4
    world, _ = world_of(robot)
    assert world is not None
    ready = np.append(arm.ready(Settings().ready), 0.0)
    contact = world.with_obstacles((table(), cup, basin)).nearest(ready)
    assert contact is not None
    assert contact.distance > 0.03
