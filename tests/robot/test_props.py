"""The props have the sizes of their file, and an invalid file is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from katana450.arm.robot.collision import scene_objects_of, table, world_of
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.arm.robot.props import BASIN_AT, CUP_AT, load_props
from katana450.arm.robot.robot import Robot
from katana450.errors import RobotDescriptionError
from katana450.maths.collision.world import obstacle
from katana450.resources import PROPS_PATH
from katana450.settings import Settings


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
