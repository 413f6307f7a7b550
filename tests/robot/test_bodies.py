"""The collision world of robots outside the family: bodies, pairs, and what is not checked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.extensions.bodies.robot_world import robot_world
from katana450.maths.collision.world import CollisionWorld
from tests.exchange.trees import tree
from tests.robot.hands import hand, rail


def read(tmp_path: Path, text: str) -> Robot:
    path = tmp_path / "robot.urdf"
    path.write_text(text)
    return load(path)


def pairs(world: CollisionWorld) -> set[frozenset[str]]:
    return {frozenset((world.parts[a].name, world.parts[b].name)) for a, b in world.pairs}


def test_bodies_of_a_tree_are_where_its_links_are(tmp_path: Path) -> None:
    robot = read(tmp_path, tree(3, 10))
    world, _ = robot_world(robot)
    assert world is not None
    joints = robot.joint_group
    assert any(joints.slides)
    assert len(robot.joints) > joints.n
    by_name = {link.name: link for link in robot.links}
    for q in np.random.default_rng(2).uniform(joints.lower, joints.upper, (5, joints.n)):
        frames = robot.frames(robot.joint_values(q, 0.0))
        T = world.linkage.poses(np.append(q, 0.0))
        for part in world.parts:
            (at,), (shape,) = part.T_mover_shape, part.shapes
            here = T[part.mover] @ at @ np.append(shape.centre, 1.0)
            (visual,) = by_name[part.name].visuals
            there = frames[part.name] @ visual.T_body_visual[:, 3]
            np.testing.assert_allclose(here, there, atol=1e-9)


def test_drawn_shapes_count_only_where_no_link_has_collision_shapes(tmp_path: Path) -> None:
    world, notes = robot_world(read(tmp_path, rail("visual")))
    assert world is not None
    assert [part.name for part in world.parts] == ["left", "right", "follower"]
    assert notes == ()
    mixed = rail().replace("collision>", "visual>", 2)
    world, notes = robot_world(read(tmp_path, mixed))
    assert world is not None
    assert [part.name for part in world.parts] == ["right", "follower"]
    assert notes == ("Not checked, because they have no collision shapes: left.",)


def test_rods_that_stand_for_missing_shapes_are_no_bodies(tmp_path: Path) -> None:
    bare = rail().replace("<collision>", "<!--").replace("</collision>", "-->")
    assert robot_world(read(tmp_path, bare)) == (None, ())


def test_parts_that_move_together_or_touch_at_rest_are_not_checked(tmp_path: Path) -> None:
    world, notes = robot_world(read(tmp_path, rail()))
    assert world is not None
    # The follower keeps its distance from the carriage that it follows.
    assert pairs(world) == {frozenset(("left", "right")), frozenset(("left", "follower"))}
    assert notes == ()
    world, notes = robot_world(read(tmp_path, rail(gap=0.05)))
    assert world is not None
    assert pairs(world) == {frozenset(("left", "follower"))}
    assert notes == ("Not checked, because they touch at rest: left and right.",)


def test_neighbours_are_found_across_links_without_shapes(tmp_path: Path) -> None:
    world, _ = robot_world(read(tmp_path, hand()))
    assert world is not None
    found = pairs(world)
    for finger in ("finger1", "finger2", "finger3", "finger4", "thumb"):
        # Two joints are between them, but no body.
        assert frozenset(("palm", f"{finger}_link1")) not in found
        assert frozenset((f"{finger}_link1", f"{finger}_link2")) not in found
        assert frozenset(("palm", f"{finger}_link2")) in found
    assert frozenset(("finger1_link1", "finger2_link1")) in found


@pytest.mark.parametrize("form", ["obj", "stl", "dae", "ply"])
def test_meshes_get_few_corners_and_are_read_once(
    tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.04)
    ball.export(tmp_path / f"ball.{form}")
    text = rail().replace('<box size="0.05 0.05 0.05"/>', f'<mesh filename="ball.{form}"/>')
    world, _ = robot_world(read(tmp_path, text))
    assert world is not None
    for part in world.parts:
        (shape,) = part.shapes
        assert 0.04 <= shape.radius < 0.046
    monkeypatch.setattr(trimesh, "load_scene", lambda *_: pytest.fail("read again"))
    again, _ = robot_world(read(tmp_path, text))
    assert again is not None
    assert again.fingerprint.differs_by(world.fingerprint) == 0.0


@pytest.mark.parametrize(
    ("file", "problem"), [("broken.stl", "has no points"), ("broken.dae", "cannot be read")]
)
def test_unreadable_collision_mesh_is_left_out_with_a_note(
    tmp_path: Path, file: str, problem: str
) -> None:
    (tmp_path / file).write_bytes(b"no mesh")
    text = rail().replace('<box size="0.05 0.05 0.05"/>', f'<mesh filename="{file}"/>', 1)
    world, (note,) = robot_world(read(tmp_path, text))
    assert world is not None
    assert [part.name for part in world.parts] == ["right", "follower"]
    assert "link 'left' is left out" in note
    assert problem in note
