"""Objects of any shape: blocked by contact, fixed to the hand, and replaced together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.loose_objects import check_carried, check_mounted, is_loose
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import (
    MAX_OBJECTS,
    Attachment,
    SceneObject,
    Shape,
    Zone,
    same,
)
from katana450.arm.control.state.solid import ObjectAppearance, Solid
from katana450.arm.control.state.state import Reason, State
from katana450.assembly.robot_session import describe_robot
from katana450.errors import InputError
from katana450.extensions.convex_body import convex_body
from katana450.extensions.free_place import free_place, girth
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import TableTop
from katana450.maths.water.units import MILLILITRE
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.ticks import TICK, until_rest

SLIGHTLY = 2e-5  # m


def solid_of(mesh: trimesh.Trimesh, key: str = "a1") -> Solid:
    """Return the solid as the reader of files makes it: on z = 0, about its middle."""
    (low, high), body = mesh.bounds, convex_body(mesh.vertices)
    foot = np.array((*(0.5 * (low + high)[:2]), low[2]))
    return Solid(key, tuple(high - low), body.corners - foot)


KNOT = trimesh.creation.torus(0.06, 0.02, 24, 16)
SOLID = solid_of(KNOT)


def standing(x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> FloatArray:
    return se3.from_rotation_translation(so3.rotation_z(yaw), (x, y, z))


def knot(T: FloatArray, name: str = "knot", **other: object) -> SceneObject:
    return replace(SceneObject(name, Shape.MESH, (), T, solid=SOLID), **other)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def session(shipped: Session) -> Session:
    return shipped


def begun(session: Session, *objects: SceneObject) -> State:
    state = session.begin(session.ready, 0.0, 0.0)
    return session.step(state, [cmd.ReplaceScene(objects)], TICK)


def x_of(state: State) -> FloatArray:
    return np.append(state.setpoint, state.gripper_setpoint)


def outlines(session: Session, state: State) -> list[tuple[int, FloatArray, FloatArray]]:
    """Return the hulls of the links: index of the moving body, planes (m, 3) and offsets (m,)."""
    world = session.world_at(replace(state, objects=()))
    assert world is not None
    shapes = []
    for part in world.parts:
        for T, shape in zip(part.T_mover_shape, part.shapes, strict=True):
            if part.mover:
                corners = np.frombuffer(shape.mark).reshape(-1, 3) @ T[:3, :3].T + T[:3, 3]
                mesh = trimesh.Trimesh(corners).convex_hull
                heights = np.einsum("ij,ij->i", mesh.face_normals, mesh.triangles[:, 0])
                shapes.append((part.mover, mesh.face_normals, heights))
    return shapes


def test_arm_at_full_speed_stops_before_a_mesh(session: Session) -> None:
    """The clearance is measured on points of all triangles, not on the collision shape."""
    upright = KNOT.copy()
    upright.apply_transform(se3.from_rotation_translation(so3.rotation_x(np.pi / 2), np.zeros(3)))
    scene_object = SceneObject(
        "knot", Shape.MESH, (), standing(0.40, -0.06), solid=solid_of(upright), scale=1.2
    )
    low = np.radians((30.0, -40.0, 95.0, -20.0, 0.0))
    state = session.step(session.begin(low, 0.0, 0.0), [cmd.ReplaceScene((scene_object,))], TICK)
    states = until_rest(session, state, cmd.Joint(1, -0.6))
    (finding,) = states[-1].findings
    assert finding.reason is Reason.CONTACT
    assert "knot" in (finding.parts or ())
    assert MIN_CLEARANCE - SLIGHTLY <= finding.amount < 2.0 * MIN_CLEARANCE
    dense = upright.subdivide().vertices
    points = 1.2 * (dense - (0.0, 0.0, dense[:, 2].min())) + scene_object.T[:3, 3]
    world = session.world_at(states[-1])
    assert world is not None
    links = outlines(session, states[-1])
    for passed in states[::120] + states[-1:]:
        poses = world.linkage.poses(x_of(passed))
        for mover, normals, heights in links:
            local = (points - poses[mover][:3, 3]) @ poses[mover][:3, :3]
            assert (local @ normals.T - heights).max(axis=1).min() > 0.0
    bare = session.begin(low, 0.0, 0.0)
    bare = session.step(bare, [cmd.ReplaceScene(()), cmd.Joint(1, -0.6)], TICK)
    assert until_rest(session, bare)[-1].findings == ()


def test_attached_object_moves_with_the_hand(session: Session) -> None:
    ready = session.begin(session.ready, 0.0, 0.0)
    palm = session.environment.pose(replace(knot(np.eye(4)), fixed=True), x_of(ready))
    state = begun(session, knot(palm @ standing(0.1, 0.0, 0.02)))
    before = session.environment.pose(state.objects[0], x_of(state))
    state = session.step(state, [cmd.Attach("knot", Attachment.HAND)], state.t + TICK)
    (fixed,) = state.objects
    assert fixed.fixed
    assert not fixed.held
    np.testing.assert_allclose(session.environment.pose(fixed, x_of(state)), before, atol=1e-12)
    moved = until_rest(session, state, cmd.Joint(1, 0.4), cmd.Gripper(0.3))[-1]
    assert moved.gripper_setpoint == 0.3
    (carried,) = moved.objects
    assert carried is fixed
    turned = session.environment.pose(fixed, x_of(moved))
    azimuth = [np.arctan2(T[1, 3], T[0, 3]) for T in (before, turned)]
    assert azimuth[1] - azimuth[0] == pytest.approx(0.4, abs=1e-9)
    # It is a part of the arm: it can touch the table, but not the hand.
    world = session.world_at(moved)
    assert world is not None
    assert np.isfinite(world.gap(x_of(moved), "knot", "table"))
    hand = session.environment.hand
    assert hand is not None
    assert all(world.gap(x_of(moved), "knot", finger) == np.inf for finger in hand.fingers)
    low = until_rest(session, moved, cmd.Joint(2, 0.3))[-1]
    (finding,) = (finding for finding in low.findings if finding.reason is Reason.CONTACT)
    assert set(finding.parts or ()) == {"knot", "table"}


def test_detached_object_stays_in_place(session: Session) -> None:
    palm_at = np.eye(4)
    palm_at[:3, 3] = (0.08, 0.0, 0.0)
    state = begun(session, knot(palm_at, fixed=True))
    T = session.environment.pose(state.objects[0], x_of(state))
    state = session.step(state, [cmd.Attach("knot", Attachment.WORLD)], state.t + TICK)
    (left,) = state.objects
    assert not left.carried
    np.testing.assert_allclose(left.T, T, atol=1e-12)


def test_scene_is_replaced_in_one_step(session: Session, state: State) -> None:
    cup = next(scene_object for scene_object in state.objects if scene_object.name == "cup")
    state = session.step(state, [cmd.ReplaceScene((cup, knot(standing(0.4, 0.3))), 1e-4)], TICK)
    assert [scene_object.name for scene_object in state.objects] == ["cup", "knot"]
    assert state.poured is not None
    assert state.poured.water.cup.volume == 100 * MILLILITRE
    held = replace(cup, held=True, T=np.eye(4))
    after = session.step(
        replace(state, objects=(held,), grip=0.0), [cmd.ReplaceScene((cup,))], state.t + TICK
    )
    assert [scene_object.held for scene_object in after.objects] == [True]
    assert after.poured is None


def test_appearance_is_part_of_the_object(session: Session) -> None:
    plain = knot(standing(0.4, 0.3))
    for other in (
        replace(plain, appearance=ObjectAppearance((1, 2, 3))),
        replace(plain, appearance=ObjectAppearance(hidden=True)),
        replace(plain, scale=2.0),
        replace(plain, solid=solid_of(KNOT, "b2")),
        replace(plain, fixed=True),
    ):
        assert not same((plain,), (other,))
        assert same((other,), (replace(other, T=other.T.copy()),))
    hidden = begun(session, replace(plain, appearance=ObjectAppearance(hidden=True)))
    world = session.world_at(hidden)
    assert world is not None
    assert "knot" in {part.name for part in world.parts}


def test_mesh_of_the_same_size_changes_the_world(session: Session) -> None:
    """Otherwise a plan made beside one mesh would count as clear of the other."""
    ball = trimesh.creation.icosphere(2, radius=0.05)
    box = trimesh.creation.box(ball.extents)
    fingerprints = []
    for mesh in (ball, box, box):
        scene_object = SceneObject("it", Shape.MESH, (), standing(0.4, 0.3), solid=solid_of(mesh))
        world = session.world_at(begun(session, scene_object))
        assert world is not None
        fingerprints.append(world.fingerprint)
    assert fingerprints[0].differs_by(fingerprints[1]) == np.inf
    assert fingerprints[1].differs_by(fingerprints[2]) == 0.0


def test_invalid_objects_are_refused(session: Session) -> None:
    T, solid = standing(0.4, 0.3), SOLID
    for wrong in (
        lambda: SceneObject("it", Shape.MESH, (), T),
        lambda: SceneObject("it", Shape.BOX, (0.1, 0.1, 0.1), T, solid=solid),
        lambda: knot(T, scale=0.0),
        lambda: knot(T, scale=np.nan),
        lambda: knot(T, scale=900.0),
        lambda: knot(T, scale=1e-3),
        lambda: knot(T, fixed=True, held=True),
        lambda: ObjectAppearance((0, 0, 256)),
        lambda: ObjectAppearance(opacity=0.0),
        lambda: Solid("no key", (1.0, 1.0, 1.0), solid.corners),
        lambda: Solid("k", (1.0, 1.0, np.inf), solid.corners),
        lambda: Solid("k", (1.0, 1.0, 1.0), np.zeros((3, 3))),
        lambda: Solid("k", (1.0, 1.0, 1.0), np.full((5, 3), np.nan)),
        lambda: cmd.Attach("it", "hand"),  # type: ignore[arg-type]
        lambda: cmd.Attach("it", Attachment.HAND, np.zeros(3)),
        lambda: cmd.Attach("it", Attachment.HAND, np.full((4, 4), np.nan)),
        lambda: cmd.ReplaceScene((knot(T), knot(T))),
        lambda: cmd.ReplaceScene(tuple(knot(T, f"{i}") for i in range(MAX_OBJECTS + 1))),
        lambda: cmd.ReplaceScene((knot(T, held=True),)),
    ):
        with pytest.raises(InputError):
            wrong()
    for command in (
        cmd.ReplaceScene((), 1e-4),
        cmd.ReplaceScene(session.begin(session.ready, 0, 0).objects, 1),
    ):
        with pytest.raises(InputError):
            session.check(command)
    blind = Session(session.require_arm(), session.ready)
    for unsupported in (
        cmd.Attach("it", Attachment.HAND),
        cmd.PlaceObject(knot(T, fixed=True)),
        cmd.ReplaceScene((knot(T, fixed=True),)),
    ):
        with pytest.raises(InputError, match="no collision checking"):
            blind.check(unsupported)


def test_new_objects_are_placed_in_reach_and_apart() -> None:
    objects: list[SceneObject] = []
    for number in range(12):
        new = knot(np.eye(4), f"{number}", scale=0.6)
        objects.append(replace(new, T=free_place(new, objects)))
    places = np.array([scene_object.T[:2, 3] for scene_object in objects])
    np.testing.assert_array_equal(places[0], (0.36, 0.0))
    apart = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(12)
    assert apart.min() >= 2.0 * girth(objects[0])
    assert np.linalg.norm(places, axis=1).max() <= 0.6
    # A place that is wanted is taken if it is free and clear of the arm, otherwise one near it.
    new = knot(np.eye(4), "new", scale=0.6)
    side = free_place(new, [], near=(0.1, 0.5))
    np.testing.assert_array_equal(side[:3, 3], (0.1, 0.5, 0.0))
    place = free_place(new, [replace(new, name="there", T=side)], near=(0.1, 0.5))[:2, 3]
    assert 2.0 * girth(new) <= np.linalg.norm(place - (0.1, 0.5)) < 0.25
    behind = free_place(new, [], near=(-0.3, 0.0))[:2, 3]
    assert np.linalg.norm(behind - (-0.3, 0.0)) < 0.1
    before = free_place(new, [], near=(-0.1, 0.05))[:2, 3]
    assert np.linalg.norm(before) >= 0.36 - 1e-9
    # A carried object and the object itself take no place.
    carried = [replace(objects[0], fixed=True), *objects[1:]]
    np.testing.assert_array_equal(
        free_place(knot(np.eye(4), "new", scale=0.6), carried)[:2, 3], places[0]
    )


TABLE = TableTop((-0.25, 0.75), (-0.7, 0.7), -0.025)


def at(x: float, y: float, z: float, R: FloatArray | None = None) -> FloatArray:
    return se3.from_rotation_translation(np.eye(3) if R is None else R, (x, y, z))


def can(T: FloatArray, name: str = "can") -> SceneObject:
    return SceneObject(name, Shape.CYLINDER, (0.03, 0.1), T, can_be_held=True)


def crate(T: FloatArray) -> SceneObject:
    return SceneObject("crate", Shape.BOX, (0.2, 0.1, 0.15), T)


@pytest.mark.parametrize(("x", "y"), [(0.3, 0.0), (-0.249, 0.0), (0.749, 0.699), (0.0, -0.699)])
def test_table_carries_objects_whose_middle_is_over_it(x: float, y: float) -> None:
    check_carried(TABLE, (), can(at(x, y, 0.0)))


@pytest.mark.parametrize(("x", "y"), [(1.5, 0.0), (-0.251, 0.0), (0.0, 0.701), (0.751, -0.701)])
def test_object_beyond_the_table_is_refused(x: float, y: float) -> None:
    with pytest.raises(InputError, match="nothing carries it there") as refused:
        check_carried(TABLE, (), can(at(x, y, 0.0)))
    assert f"x {1e3 * x:.1f}, y {1e3 * y:.1f} mm" in str(refused.value)
    assert "from x -250 to 750 and from y -700 to 700 mm" in str(refused.value)


def test_object_above_the_table_is_in_the_air() -> None:
    with pytest.raises(InputError, match=r"120\.0 mm above its support"):
        check_carried(TABLE, (), can(at(0.3, 0.0, 0.12)))


def test_object_may_fall_on_the_table_but_not_beside_it() -> None:
    check_carried(TABLE, (), can(at(0.3, 0.0, 0.12)), may_fall=True)
    with pytest.raises(InputError, match="nothing carries it there"):
        check_carried(TABLE, (), can(at(1.5, 0.0, 0.12)), may_fall=True)


def test_object_lying_on_its_side_stands_on_its_lowest_point() -> None:
    lying = so3.rotation_y(np.pi / 2.0)
    check_carried(TABLE, (), can(at(0.3, 0.0, 0.03, lying)))
    with pytest.raises(InputError, match=r"20\.0 mm above"):
        check_carried(TABLE, (), can(at(0.3, 0.0, 0.05, lying)))


def test_object_stands_on_another_one() -> None:
    below = crate(at(0.3, 0.2, 0.0, so3.rotation_z(np.pi / 2.0)))
    check_carried(TABLE, (below,), can(at(0.3, 0.29, 0.15)))
    with pytest.raises(InputError, match=r"150\.0 mm above"):
        check_carried(TABLE, (below,), can(at(0.39, 0.2, 0.15)))
    beyond = crate(at(1.5, 0.0, 0.0))
    check_carried(TABLE, (beyond,), can(at(1.5, 0.0, 0.15)))


def test_only_work_cell_parts_may_hang_in_the_air() -> None:
    far = at(1.5, 0.0, 0.4)
    assert not is_loose(crate(far))
    assert is_loose(can(far))
    assert is_loose(SceneObject("basin", Shape.CYLINDER, (0.1, 0.1), far))


def test_scene_with_the_cup_in_the_air_is_refused_as_a_whole() -> None:
    session = describe_robot(Settings(), URDF_PATH, None).session
    table = session.environment.table
    assert table is not None
    assert (table.x, table.y) == (TABLE.x, TABLE.y)
    session.check(cmd.ReplaceScene((can(at(0.3, 0.0, 0.0)), crate(at(1.5, 0.0, 0.4)))))
    with pytest.raises(InputError, match="can would be in the air"):
        session.check(cmd.ReplaceScene((can(at(1.5, 0.0, 0.0)), crate(at(0.5, 0.3, 0.0)))))
    session.check(cmd.ReplaceScene((can(at(1.5, 0.0, 0.15)), crate(at(1.5, 0.0, 0.0)))))


def test_detached_object_may_fall_on_the_table_but_not_beside_it() -> None:
    rules = describe_robot(Settings(), URDF_PATH, None).session
    x = rules.begin(rules.ready, 0.0, 0.0).x
    around: Environment = rules.environment
    held = around.mounted(can(at(0.3, 0.0, 0.3)), Attachment.HAND, x)
    assert held.fixed
    check_mounted(around, (), held, Attachment.WORLD, x)
    outside = around.mounted(can(at(1.5, 0.0, 0.3)), Attachment.HAND, x)
    with pytest.raises(InputError, match="nothing carries it there"):
        check_mounted(around, (), outside, Attachment.WORLD, x)
    camera = around.mounted(crate(at(0.3, 0.0, 0.3)), Attachment.HAND, x)
    check_mounted(around, (), camera, Attachment.WORLD, x)


def test_object_that_stands_in_a_link_is_named_with_its_depth() -> None:
    rules = describe_robot(Settings(), URDF_PATH, None).session
    environment, x = rules.environment, rules.begin(rules.ready, 0.0, 0.0).x
    box = SceneObject("block", Shape.BOX, (0.04, 0.04, 0.04), at(0.0, 0.0, 0.0))
    text = environment.overlap(box, x)
    assert text == "block overlaps the control box by 29 mm: move it, or undo."
    assert "shoulder" in environment.overlap(replace(box, T=at(0.0, 0.0, 0.2)), x)
    for other in (
        replace(box, T=at(0.36, 0.0, -0.01)),
        replace(box, zone=Zone.SLOW),
        replace(box, fixed=True),
    ):
        assert environment.overlap(other, x) == ""
    objects = rules.begin(rules.ready, 0.0, 0.0).objects
    assert not any(environment.overlap(item, x) for item in objects)
