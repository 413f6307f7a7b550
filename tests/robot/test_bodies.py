"""The collision world of robots outside the family: bodies, pairs, and what is not checked."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from katana450.arm.control.state.messages import UNCHECKED
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import find_arm, find_robot
from katana450.extensions.bodies.robot_world import robot_world
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.settings import Settings
from tests.exchange.trees import tree
from tests.general_arms.links_of_arms import ur5e
from tests.robot.hands import column, hand, rail
from tests.robot.urdf_files import saved


def read(tmp_path: Path, text: str) -> Robot:
    return load(saved(tmp_path, text))


def pairs(world: CollisionWorld) -> set[frozenset[str]]:
    """Return the pairs of the robot's own parts, which test_table.py leaves out."""
    pairs = {frozenset((world.parts[a].name, world.parts[b].name)) for a, b in world.pairs}
    return {pair for pair in pairs if "table" not in pair}


def own(world: CollisionWorld) -> list[Part]:
    return [part for part in world.parts if part.name != "table"]


def test_bodies_of_a_tree_are_where_its_links_are(tmp_path: Path) -> None:
    robot = read(tmp_path, tree(3, 10))
    world, _, _ = robot_world(robot)
    assert world is not None
    joints = robot.joint_group
    assert any(joints.slides)
    assert len(robot.joints) > joints.n
    by_name = {link.name: link for link in robot.links}
    for q in np.random.default_rng(2).uniform(joints.lower, joints.upper, (5, joints.n)):
        frames = robot.frames(robot.joint_values(q, 0.0))
        T = world.linkage.poses(np.append(q, 0.0))
        for part in own(world):
            (T_shape,), (shape,) = part.T_mover_shape, part.shapes
            point = T[part.mover] @ T_shape @ np.append(shape.centre, 1.0)
            (visual,) = by_name[part.name].visuals
            expected = frames[part.name] @ visual.T_body_visual[:, 3]
            np.testing.assert_allclose(point, expected, atol=1e-9)


def test_drawn_shapes_count_only_where_no_link_has_collision_shapes(tmp_path: Path) -> None:
    world, notes, _ = robot_world(read(tmp_path, rail("visual")))
    assert world is not None
    assert [part.name for part in own(world)] == ["left", "right", "follower"]
    assert notes == ()
    mixed = rail().replace("collision>", "visual>", 2)
    read(tmp_path, mixed)
    robot, session, _ = find_robot(Settings(), tmp_path / "robot.urdf", None)
    assert session.world is not None
    assert [part.name for part in own(session.world)] == ["right", "follower"]
    assert robot.cautions == ("Not checked for contacts: 'left'.",)


@pytest.mark.parametrize("length", [0.0, 1.0])
def test_sticks_of_a_robot_without_shapes_are_bodies(tmp_path: Path, length: float) -> None:
    bare = rail().replace("<collision>", "<!--").replace("</collision>", "-->")
    bare = re.sub('<origin xyz="[^"]*"', f'<origin xyz="{length} 0 0"', bare)
    world, _, cautions = robot_world(read(tmp_path, bare))
    if length:
        assert world is not None
        assert [part.name for part in own(world)] == ["base"]
        assert len(cautions) == 1
    else:
        assert (world, cautions) == (None, (UNCHECKED,))


def test_parts_that_move_together_or_touch_at_rest_are_not_checked(tmp_path: Path) -> None:
    world, notes, _ = robot_world(read(tmp_path, rail()))
    assert world is not None
    # The follower keeps its distance from the carriage that it follows.
    assert pairs(world) == {frozenset(("left", "right")), frozenset(("left", "follower"))}
    assert notes == ()
    world, notes, _ = robot_world(read(tmp_path, rail(gap=0.05)))
    assert world is not None
    assert pairs(world) == {frozenset(("left", "follower"))}
    assert notes == ("Not checked, because they touch at rest: left and right.",)


def test_neighbours_are_found_across_links_without_shapes(tmp_path: Path) -> None:
    world, _, _ = robot_world(read(tmp_path, hand()))
    assert world is not None
    checked = pairs(world)
    for finger in ("finger1", "finger2", "finger3", "finger4", "thumb"):
        # Two joints are between them, but no body.
        assert frozenset(("palm", f"{finger}_link1")) not in checked
        assert frozenset((f"{finger}_link1", f"{finger}_link2")) not in checked
        assert frozenset(("palm", f"{finger}_link2")) in checked
    assert frozenset(("finger1_link1", "finger2_link1")) in checked


def folded(height: float) -> str:
    """Return an arm that is folded at zero: its forearm hangs beside its upper arm to the post.

    height: of the post [m]; a low one does not reach the forearm. A cuff around the elbow rolls
    with the tool, so it touches the upper arm in every posture.
    """
    links = {
        "post": ((0.0, 0.0, 0.5 * height), (0.06, 0.06, height)),
        "upper": ((0.0, 0.0, 0.15), (0.04, 0.04, 0.3)),
        "forearm": ((0.045, 0.0, -0.17), (0.04, 0.04, 0.28)),
        "cuff": ((0.0, 0.0, 0.0), (0.06, 0.08, 0.06)),
    }
    joints = (
        ("pan", "base", "post", (0.0, 0.0, 0.0), "0 0 1", 3.0),
        ("lift", "post", "upper", (0.0, 0.0, 0.1), "0 1 0", 2.0),
        ("bend", "upper", "forearm", (0.0, 0.0, 0.3), "0 1 0", 2.8),
        ("roll", "forearm", "cuff", (0.0, 0.0, 0.0), "0 0 1", 3.0),
    )
    parts = ['<robot name="folded"><link name="base"/>']
    for name, (place, size) in links.items():
        x, y, z = place
        a, b, c = size
        parts.append(
            f'<link name="{name}"><collision><origin xyz="{x} {y} {z}"/>'
            f'<geometry><box size="{a} {b} {c}"/></geometry></collision></link>'
        )
    for name, above, link, (x, y, z), axis, end in joints:
        parts.append(
            f'<joint name="{name}" type="revolute"><parent link="{above}"/><child link="{link}"/>'
            f'<origin xyz="{x} {y} {z}"/><axis xyz="{axis}"/>'
            f'<limit lower="-{end}" upper="{end}" velocity="1" effort="1"/></joint>'
        )
    parts.append(
        '<link name="tool0"/><joint name="tip" type="fixed"><parent link="cuff"/>'
        '<child link="tool0"/><origin xyz="0.045 0 -0.35"/></joint></robot>'
    )
    return "".join(parts)


def test_parts_that_touch_at_zero_and_are_apart_at_home_are_checked(tmp_path: Path) -> None:
    path = saved(tmp_path, folded(0.16))
    robot = load(path, find=find_arm)
    world, notes, _ = robot_world(robot)
    assert world is not None
    assert frozenset(("post", "forearm")) in pairs(world)
    assert frozenset(("upper", "cuff")) not in pairs(world)
    assert notes == ("Not checked, because they touch at rest: upper and cuff.",)
    arm = robot.require_arm()
    # Folded, the forearm is in the post; at Home it is not.
    for q, meet in ((np.zeros(4), True), (arm.ready(()), False)):
        nearest = world.nearest(np.append(q, 0.0))
        assert (nearest is not None and nearest.distance < MIN_CLEARANCE) == meet
    # Driven joint by joint the robot has no Home, so what touches at zero is not checked.
    world, notes, _ = robot_world(load(path))
    assert world is not None
    assert frozenset(("post", "forearm")) not in pairs(world)
    assert "post and forearm" in notes[0]


def test_parts_that_are_apart_at_zero_are_checked_as_before(tmp_path: Path) -> None:
    path = saved(tmp_path, folded(0.05))
    world, notes, _ = robot_world(load(path, find=find_arm))
    assert world is not None
    assert frozenset(("post", "forearm")) in pairs(world)
    assert notes == ("Not checked, because they touch at rest: upper and cuff.",)


@pytest.mark.cases(2)
@pytest.mark.parametrize("form", ["obj", "stl", "dae", "ply"])
def test_meshes_get_few_corners_and_are_read_once(
    tmp_path: Path, form: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.04)
    ball.export(tmp_path / f"ball.{form}")
    text = rail().replace('<box size="0.05 0.05 0.05"/>', f'<mesh filename="ball.{form}"/>')
    world, _, _ = robot_world(read(tmp_path, text))
    assert world is not None
    for part in own(world):
        (shape,) = part.shapes
        assert 0.04 <= shape.radius < 0.046
    monkeypatch.setattr(trimesh, "load_scene", lambda *_: pytest.fail("read again"))
    again, _, _ = robot_world(read(tmp_path, text))
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
    world, (note,), _ = robot_world(read(tmp_path, text))
    assert world is not None
    assert [part.name for part in own(world)] == ["right", "follower"]
    assert "link 'left' is left out" in note
    assert problem in note


def with_table(tmp_path: Path, text: str) -> tuple[CollisionWorld, tuple[str, ...]]:
    world, notes, _ = robot_world(load(saved(tmp_path, text)))
    assert world is not None
    return world, notes


def table_of(world: CollisionWorld) -> float:
    (table,) = (part for part in world.parts if part.name == "table")
    return float(table.T_mover_shape[0][2, 3])


def over_the_table(world: CollisionWorld) -> set[str]:
    """Return the names of the parts that are checked against the table."""
    number = [part.name for part in world.parts].index("table")
    return {world.parts[a].name for a, b in world.pairs if b == number}


@pytest.mark.parametrize("foot", [0.0, -0.3, -2e-5])
def test_table_is_under_the_lowest_point(tmp_path: Path, foot: float) -> None:
    world, notes = with_table(tmp_path, column(foot))
    assert table_of(world) == pytest.approx(0.0 if foot > -1e-4 else foot, abs=1e-6)
    assert over_the_table(world) == {"beam"}
    wanted = ("The table is 300 mm below the base.",) if foot < -1e-4 else ()
    assert notes == wanted


def test_table_is_at_the_base_of_a_robot_that_is_higher(tmp_path: Path) -> None:
    world, notes = with_table(tmp_path, rail())
    assert (table_of(world), notes) == (0.0, ())
    assert over_the_table(world) == {"left", "right", "follower"}


def test_every_finger_of_a_hand_may_meet_the_table_under_its_palm(tmp_path: Path) -> None:
    world, notes = with_table(tmp_path, hand())
    assert (table_of(world), notes) == (0.0, ())
    assert over_the_table(world) == {part.name for part in world.parts} - {"palm", "table"}


def test_robot_with_a_moving_part_below_its_base_has_no_table(tmp_path: Path) -> None:
    world, notes = with_table(tmp_path, column(-0.1, carried="wheel"))
    assert "table" not in {part.name for part in world.parts}
    (note,) = notes
    assert note.endswith(
        "nothing says where the robot stands, and wheel is below its base at rest."
    )


def test_part_that_is_near_the_table_at_rest_keeps_half_of_its_distance(tmp_path: Path) -> None:
    low = column().replace('xyz="0 0 0.35"', 'xyz="0 0 0.024"').replace('"-0.4"', '"-0.01"')
    world, _ = with_table(tmp_path, low)
    number = [part.name for part in world.parts].index("table")
    distances = {world.parts[a].name: d for (a, b), d in world.close.items() if b == number}
    assert distances == {"beam": pytest.approx(2e-3, abs=1e-6)}


def test_arm_has_its_table_in_its_session(tmp_path: Path) -> None:
    path = saved(tmp_path, ur5e())
    world, _, _ = robot_world(load(path, find=find_arm))
    assert world is not None
    assert "table" not in {part.name for part in world.parts}
    # Without its arm it is driven joint by joint, and has one.
    world, _, _ = robot_world(load(path))
    assert world is not None
    np.testing.assert_allclose(table_of(world), 0.0)
