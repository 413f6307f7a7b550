"""Loose objects of the app's own session: they fall, come to rest, and wake."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.pouring import CUP
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.assembly.robot_session import describe_robot
from katana450.maths.collision.shape import box, cylinder, sphere
from katana450.maths.collision.world import Part
from katana450.maths.geometry import so3
from katana450.maths.physics.model import BodyMotion
from katana450.resources import URDF_PATH
from katana450.settings import Settings
from tests.physics.scenes import HALF, TABLE, Scene, body, pose, same_bits, slider, with_velocity
from tests.ticks import during, states

SIDE = 0.04  # m
SHOWN = 1e-3  # m


@pytest.fixture(scope="module")
def session() -> Session:
    return describe_robot(Settings(), URDF_PATH, None).session


@pytest.fixture
def state(session: Session) -> State:
    return session.begin(session.ready, 0.0, 0.0)


def block(name: str, x: float, y: float, z: float = 0.0, size: float = SIDE) -> SceneObject:
    """Return a box of equal sides, ``z`` [m] above the table."""
    return SceneObject(name, Shape.BOX, (size, size, size), pose(x, y, z), can_be_held=True)


def ball(name: str, x: float, y: float, z: float, radius: float = 0.012) -> SceneObject:
    return SceneObject(name, Shape.SPHERE, (radius,), pose(x, y, z), can_be_held=True)


def with_objects(state: State, *objects: SceneObject) -> tuple[cmd.Command, ...]:
    """Return the commands that add ``objects`` on the table and move them to their places."""
    standing = [
        replace(scene_object, T=pose(0.6, -0.6 + 0.02 * number, 0.0))
        for number, scene_object in enumerate(objects)
    ]
    scene = cmd.ReplaceScene((*state.objects, *standing))
    return scene, *(
        cmd.MoveObject(item.name, position=item.T[:3, 3], R=item.T[:3, :3]) for item in objects
    )


def named(state: State, name: str) -> SceneObject:
    return next(scene_object for scene_object in state.objects if scene_object.name == name)


def rested(session: Session, state: State, *commands: cmd.Command) -> State:
    """Return the state in which all objects rest, after ``commands``."""
    for number, after in enumerate(islice(states(session, state, *commands), 400)):
        if after.bodies is None:
            assert number > 1, "Nothing moves."
            return after
    raise AssertionError("The objects do not come to rest.")


def test_objects_in_the_air_fall_and_come_to_rest(session: Session, state: State) -> None:
    tilted = replace(block("tilted", 0.4, 0.1), T=pose(0.4, 0.1, 0.2, so3.rotation_x(0.4)))
    can = SceneObject("can", Shape.CYLINDER, (0.02, 0.06), pose(0.45, 0.0, 0.1), can_be_held=True)
    after = rested(
        session, state, *with_objects(state, block("block", 0.4, 0.0, 0.15), tilted, can)
    )
    for name, x in (("block", 0.4), ("can", 0.45)):
        np.testing.assert_allclose(named(after, name).T, pose(x, 0.0, 0.0), rtol=0, atol=SHOWN)
    T = named(after, "tilted").T_collision_shape
    assert T[2, 3] == pytest.approx(0.5 * SIDE, abs=SHOWN)
    # A face is below.
    assert np.abs(T[2, :3]).max() == pytest.approx(1.0, abs=1e-3)


def test_object_falls_onto_a_part_of_the_work_cell(session: Session, state: State) -> None:
    shelf = replace(block("shelf", 0.4, 0.0, 0.1), can_be_held=False)
    after = rested(session, state, *with_objects(state, shelf, block("block", 0.4, 0.0, 0.2)))
    assert named(after, "block").T[:3, 3] == pytest.approx((0.4, 0.0, 0.1 + SIDE), abs=SHOWN)


def test_ball_falls_into_the_cup(session: Session, state: State) -> None:
    x, y, z = named(state, CUP).T[:3, 3]
    after = rested(session, state, *with_objects(state, ball("ball", x + 0.004, y, z + 0.15)))
    cup, T = named(after, CUP).T, named(after, "ball").T_collision_shape
    assert np.hypot(*(T[:2, 3] - cup[:2, 3])) < 0.02
    assert 0.012 <= T[2, 3] - cup[2, 3] < 0.03
    np.testing.assert_allclose(cup, named(state, CUP).T, rtol=0, atol=5e-3)


def test_object_beyond_the_table_falls_to_the_floor(session: Session, state: State) -> None:
    table = session.environment.table
    assert table is not None
    after = rested(session, state, *with_objects(state, block("block", 0.3, table.y[1] + 0.05)))
    assert named(after, "block").T[2, 3] == pytest.approx(table.floor, abs=SHOWN)


def test_objects_at_rest_do_not_change_to_the_bit(session: Session, state: State) -> None:
    blocks = [
        block(f"block {n}", 0.25 + 0.06 * (n % 5), -0.15 + 0.08 * (n // 5)) for n in range(20)
    ]
    before = rested(session, state, *with_objects(state, *blocks))
    assert len(before.objects) == 22
    passed = during(session, before, 1.0)
    assert all(after.objects is before.objects and after.bodies is None for after in passed)
    # Also while the arm moves, with nothing in its hand.
    moving = during(session, before, 1.0, cmd.Joints(session.ready + 0.1))
    assert moving[-1].setpoint.tolist() != before.setpoint.tolist()
    assert all(after.objects is before.objects and after.bodies is None for after in moving)


def test_moved_object_wakes_only_what_is_beside_it(session: Session, state: State) -> None:
    objects = block("near", 0.4, 0.0), block("far", 0.4, 0.3), block("moved", 0.3, 0.1)
    before = rested(session, state, *with_objects(state, *objects))
    move = cmd.MoveObject("moved", position=np.array((0.4, 0.01, SIDE + 0.02)))
    passed = during(session, before, 2.0, move)
    awake = {
        name
        for after in passed
        if after.bodies is not None
        for name, resting in zip(after.bodies.names, after.bodies.resting, strict=True)
        if not resting
    }
    assert awake == {"near", "moved"}
    assert (named(passed[-1], "far").T == named(before, "far").T).all()
    assert named(passed[-1], "moved").T[2, 3] == pytest.approx(SIDE, abs=SHOWN)


TICKS = 40
"""Ticks of the whole motion."""


def scene() -> Scene:
    """Return bodies that fall onto others, roll, and are pushed by a link."""
    hand = Part("hand", 1, (pose(-0.06, 0.0, 0.02),), (box((0.02, 0.1, 0.04)),))
    tilted = so3.rotation_x(0.4) @ so3.rotation_y(0.3)
    bodies = {
        body("lower"): pose(0.0, 0.0, HALF),
        body("upper"): pose(0.01, 0.0, 4.0 * HALF, tilted),
        body("ball", sphere(0.02)): pose(0.0, 0.1, 0.1),
        body("can", cylinder(0.02, 0.08)): pose(0.05, 0.02, 0.2, tilted),
        body("resting"): pose(0.1, 0.0, HALF),
    }
    return Scene(bodies, TABLE, hand, linkage=slider())


def first(bodies: Scene) -> BodyMotion:
    return with_velocity(bodies.begin("resting"), "ball", 0.5, -0.5, 0.0)


def course(bodies: Scene) -> list[BodyMotion]:
    """Return the motions of a course in which the link moves at 0.1 m/s."""
    return [*bodies.motions(first(bodies), 0.01 * TICKS, speed=0.1)]


@pytest.fixture(scope="module")
def motions() -> list[BodyMotion]:
    return course(scene())


def test_course_has_contacts_and_wakes_what_rested(motions: list[BodyMotion]) -> None:
    assert not motions[-1].resting.all()
    assert np.abs(motions[-1].place[-1] - motions[0].place[-1]).max() > 1e-3


def test_another_simulation_continues_with_the_same_bits(motions: list[BodyMotion]) -> None:
    # It has passed through other states before.
    used = scene()
    used.after(used.begin(), 0.1)
    again = course(used)
    assert [*map(same_bits, motions, again)] == [True] * TICKS


@pytest.mark.parametrize("number", range(4, TICKS, 7))
def test_interrupted_motion_continues_with_the_same_bits(
    motions: list[BodyMotion], number: int
) -> None:
    stored = pickle.loads(pickle.dumps(motions[number]))
    continued = scene()
    motion = continued.simulation.begin(continued.poses, stored, (), ())
    for tick in range(number + 1, min(number + 6, TICKS)):
        x, towards = (np.array((0.1 * 0.01 * (tick + step),)) for step in (0, 1))
        motion = continued.simulation.step(motion, x, towards, 0.01)
        assert same_bits(motion, motions[tick])


def test_step_changes_none_of_its_arguments() -> None:
    bodies = scene()
    motion = first(bodies)
    before = pickle.dumps(motion)
    x = np.zeros(1)
    once, again = (bodies.simulation.step(motion, x, x, 0.01) for _ in range(2))
    assert pickle.dumps(motion) == before
    assert same_bits(once, again)
    with pytest.raises(ValueError, match="read-only"):
        once.place[0, 0] = 1.0


def test_motion_of_other_bodies_begins_without_their_forces(motions: list[BodyMotion]) -> None:
    bodies = scene()
    fewer = Scene({body("upper"): bodies.poses["upper"], body("new"): pose(0.3, 0.3, HALF)})
    motion = fewer.simulation.begin(fewer.poses, motions[-1], (), ())
    assert motion.names == ("upper", "new")
    assert (motion.place[0] == motions[-1].place[1]).all()
    assert (motion.velocity[0] == motions[-1].velocity[1]).all()
    assert motion.resting[1]
    assert not motion.memory.any()


def test_motion_is_continued_among_other_links(motions: list[BodyMotion]) -> None:
    still = scene()
    alone = Scene({piece: still.poses[piece.name] for piece in still.bodies})
    motion = alone.simulation.begin(alone.poses, motions[-1], (), ())
    after = alone.after(motion, 0.1)
    assert np.isfinite(after.place).all()
    assert len(after.memory) == 6 * len(after.names)
