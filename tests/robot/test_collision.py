"""The collision bodies follow from the shapes in a URDF."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from katana450.arm.robot import collision
from katana450.arm.robot.collision import world_of
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot

ARMS = Path(__file__).resolve().parent / "arms"
PINCHER = ARMS / "pincherx_150.urdf"


def with_forearm(tmp_path: Path, shapes: str) -> Robot:
    text = PINCHER.read_text(encoding="utf-8")
    assert '<link name="forearm"/>' in text
    path = tmp_path / "edited.urdf"
    path.write_text(text.replace('<link name="forearm"/>', f'<link name="forearm">{shapes}</link>'))
    return load(path)


def test_an_arm_without_shapes_has_no_world() -> None:
    robot = load(PINCHER)
    assert not robot.collides
    assert world_of(robot) == (None, ())


def test_an_arm_without_collision_shapes_is_checked_by_what_is_drawn() -> None:
    robot = load(ARMS / "youbot_arm.urdf")
    assert not robot.collides
    world, notes = world_of(robot)
    assert world is not None
    drawn = [link.name for link in robot.links if any(not v.is_rod for v in link.visuals)]
    assert [part.name for part in world.parts] == drawn
    assert drawn
    assert notes == ()


def test_world_of_the_katana_has_every_link(robot: Robot) -> None:
    world, notes = world_of(robot)
    assert notes == ()
    assert world is not None
    shaped = [body for body in robot.links if body.collisions]
    assert [part.name for part in world.parts] == [body.name for body in shaped]
    assert [len(part.shapes) for part in world.parts] == [len(b.collisions) for b in shaped]


def test_pairs_that_meet_are_sampled_once(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    first, _ = world_of(robot)
    monkeypatch.setattr(collision, "pairs_that_meet", lambda *_: pytest.fail("sampled again"))
    again, _ = world_of(robot)
    assert first is not None
    assert again is not None
    np.testing.assert_array_equal(again.first, first.first)
    np.testing.assert_array_equal(again.second, first.second)


def test_primitives_have_the_poses_of_the_file(tmp_path: Path) -> None:
    model = with_forearm(
        tmp_path,
        '<collision><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/>'
        '<geometry><box size="0.2 0.04 0.06"/></geometry></collision>',
    )
    world, _ = world_of(model)
    assert model.collides
    assert world is not None
    (part,) = world.parts
    (shape,) = part.shapes
    np.testing.assert_allclose(shape.low, (0.08, -0.1, -0.03), atol=1e-9)
    np.testing.assert_allclose(shape.high, (0.12, 0.1, 0.03), atol=1e-9)


def test_shapes_without_volume_or_file_are_reported(tmp_path: Path) -> None:
    sheet = trimesh.Trimesh(vertices=[[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces=[[0, 1, 2]])
    sheet.export(tmp_path / "sheet.stl")
    mesh = '<collision><geometry><mesh filename="{}.stl"/></geometry></collision>'
    model = with_forearm(tmp_path, mesh.format("sheet") + mesh.format("none"))
    world, notes = world_of(model)
    assert world is None
    assert [note for note in notes if "'forearm'" in note and "one plane" in note]
    assert [note for note in model.notes if "none.stl" in note]
