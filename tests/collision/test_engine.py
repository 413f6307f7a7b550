"""Distances between shapes, alone and through the engine."""

from __future__ import annotations

import pickle
from _ctypes import FUNCFLAG_PYTHONAPI
from collections.abc import Callable
from itertools import combinations, product
from threading import Thread

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.collision import engine
from katana450.maths.collision.engine import Witness, distance, hull_triangles, witness
from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import (
    CollisionShape,
    box,
    cylinder,
    half_space,
    hull,
    placement,
    sphere,
)
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray

EXACT = 2e-8  # m
DEEP = 2e-6  # m

CUBE = np.array(list(product((-0.5, 0.5), repeat=3)))

SHAPES: dict[str, Callable[[], CollisionShape]] = {
    "hull": lambda: hull(CUBE * (0.1, 0.2, 0.3)),
    "box": lambda: box((0.1, 0.2, 0.3)),
    "cylinder": lambda: cylinder(0.1, 0.3),
    "sphere": lambda: sphere(0.15),
}
"""Bodies of known size, about their middle."""

UP = {"hull": 0.15, "box": 0.15, "cylinder": 0.15, "sphere": 0.15}
"""[m] How far each reaches along z."""


def at(x: float, y: float, z: float) -> FloatArray:
    return se3.from_rotation_translation(np.eye(3), np.array((x, y, z)))


HERE = at(0.0, 0.0, 0.0)


def measured(
    one: CollisionShape, T_one: FloatArray, other: CollisionShape, T_other: FloatArray
) -> Witness:
    """Return the contact, after comparing both functions for a distance."""
    placed = placement((one, T_one), (other, T_other))
    contact = witness(placed, 0, 1)
    assert distance(placed, 0, 1) == contact.distance
    assert np.linalg.norm(contact.normal) == pytest.approx(1.0, abs=1e-12)
    gap = contact.points[1] - contact.points[0]
    np.testing.assert_allclose(gap, contact.distance * contact.normal, atol=1e-7)
    return contact


@pytest.mark.parametrize("kinds", list(product(SHAPES, repeat=2)), ids="-".join)
@pytest.mark.parametrize("gap", [0.3, 1e-3, 1e-8, 0.0, -1e-8, -0.01])
def test_bodies_above_each_other(kinds: tuple[str, str], gap: float) -> None:
    """In a tilted frame, and so with other rounding."""
    one, other = kinds
    T = se3.from_rotation_translation(so3.exp((0.3, -0.7, 0.4)), np.array([0.2, 0.5, -0.1]))
    above = T @ at(0.01, 0.005, UP[one] + UP[other] + gap)
    if {one, other} == {"sphere"}:
        above = T @ at(0.0, 0.0, UP[one] + UP[other] + gap)
    contact = measured(SHAPES[one](), T, SHAPES[other](), above)
    assert contact.distance == pytest.approx(gap, abs=EXACT if gap > -1e-3 else DEEP)
    np.testing.assert_allclose(contact.normal, T[:3, 2], atol=2e-3)


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("gap", [0.3, 0.0, -0.02])
def test_bodies_above_a_plane(kind: str, gap: float) -> None:
    T = se3.from_rotation_translation(so3.exp((0.3, -0.7, 0.4)), np.array([0.2, 0.5, -0.1]))
    above = T @ at(0.7, -0.4, UP[kind] + gap)
    contact = measured(half_space(), T, SHAPES[kind](), above)
    assert contact.distance == pytest.approx(gap, abs=EXACT)
    np.testing.assert_allclose(contact.normal, T[:3, 2], atol=1e-6)
    turned = measured(SHAPES[kind](), above, half_space(), T)
    np.testing.assert_allclose(turned.normal, -contact.normal, atol=1e-6)
    assert turned.distance == contact.distance


@pytest.mark.parametrize("kind", SHAPES)
def test_bodies_about_the_same_middle_overlap(kind: str) -> None:
    shape, wide = SHAPES[kind](), box((1.0, 1.0, 0.3))
    assert measured(shape, HERE, wide, HERE).distance == pytest.approx(-0.3, abs=DEEP)
    assert measured(shape, HERE, shape, HERE).distance < -0.09


@pytest.mark.parametrize(
    ("p", "gap"), [((1.3, 0.0, 0.0), 0.3), ((1.3, 1.4, 0.0), 0.5), ((2.0, 2.0, 2.0), np.sqrt(3.0))]
)
def test_one_shape_may_stand_in_two_places(p: tuple[float, float, float], gap: float) -> None:
    cube = hull(CUBE)
    assert measured(cube, HERE, cube, at(*p)).distance == pytest.approx(gap, abs=EXACT)


def test_distances_of_the_arm_are_on_their_bounds(
    world: CollisionWorld, postures: FloatArray
) -> None:
    """No body reaches beyond the plane across its nearest point, so no distance is too large."""
    corners = {
        body: np.frombuffer(shape.mark).reshape(-1, 3)
        for body, shape in enumerate(solid for part in world.parts for solid in part.shapes)
        if shape.mark != half_space().mark
    }
    for x in postures[:10]:
        T = world.linkage.poses(x)[world.mover_of] @ world.T_mover_body
        placed = world.at(x)
        for pair in placed.nearer_than(0.15)[0].tolist():
            contact = placed.contact(pair)
            bodies = int(world.first[pair]), int(world.second[pair])
            if set(bodies) <= corners.keys():
                one, other = (corners[k] @ T[k, :3, :3].T + T[k, :3, 3] for k in bodies)
                bound = (other @ contact.normal).min() - (one @ contact.normal).max()
                assert abs(contact.distance - bound) <= (EXACT if contact.distance > 0 else DEEP)


def test_pose_that_is_not_finite_has_no_distance() -> None:
    bodies = placement((sphere(0.1), at(0.0, 0.0, 0.0)), (sphere(0.1), at(np.nan, 0.0, 0.0)))
    with pytest.raises(ArithmeticError, match="not finite"):
        distance(bodies, 0, 1)


def test_a_thread_keeps_as_many_geometries_as_it_has_room_for() -> None:
    """Many more bodies than a model has room for, in one world and one after another."""
    balls = [sphere(1e-3 * (1 + k)) for k in range(engine.GEOMETRIES + 5)]
    places = [at(k, 0.0, 0.0) for k in range(len(balls))]
    placed = placement(*zip(balls, places, strict=True))
    for k, other in ((0, len(balls) - 1), (3, 4)):
        wanted = other - k - 1e-3 * (2 + k + other)
        assert distance(placed, k, other) == pytest.approx(wanted, abs=1e-9)
    ball = sphere(0.25)
    placed = placement(*((ball, T) for T in [*places, *places]))
    assert distance(placed, 0, len(places) + 1) == pytest.approx(0.5, abs=1e-9)
    random = np.random.default_rng(2)
    for _ in range(3 * engine.VERTICES // 900):
        around = random.normal(size=(900, 3))
        around[0] = np.abs(around).max() * np.array([1.1, 0.0, 0.0])
        placed = placement((hull(around), HERE), (half_space(), at(0.0, 0.0, -9.0)))
        assert distance(placed, 0, 1) == pytest.approx(9.0 + around[:, 2].min(), abs=1e-6)


def test_hull_of_many_points_keeps_its_corners() -> None:
    points = np.random.default_rng(5).uniform(-1.0, 1.0, (engine.VERTICES, 3))
    shape = hull(np.concatenate((2.0 * CUBE, points)))
    assert len(shape.geometry.vertices) == 8
    assert measured(shape, HERE, sphere(0.5), at(0.0, 0.3, 2.0)).distance == pytest.approx(0.5)


def test_threads_measure_at_the_same_time(world: CollisionWorld, postures: FloatArray) -> None:
    wanted = [contact.distance for x in postures if (contact := world.nearest(x))]
    distances: list[list[float]] = []

    def measure() -> None:
        distances.append([contact.distance for x in postures if (contact := world.nearest(x))])

    threads = [Thread(target=measure) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert distances == [wanted] * 3


def test_a_search_keeps_the_lock_of_the_interpreter() -> None:
    """A control loop that gives it away may wait 5 ms to get it back."""
    assert engine._function()._flags_ & FUNCFLAG_PYTHONAPI


def test_shapes_can_be_pickled(world: CollisionWorld, postures: FloatArray) -> None:
    world.load()
    copied = pickle.loads(pickle.dumps(world))
    one, other = world.nearest(postures[0]), copied.nearest(postures[0])
    assert one is not None
    assert one.distance == other.distance


@pytest.mark.parametrize("size", [1e-4, 1.0, 100.0])
@pytest.mark.parametrize("flat", [1.0, 1e-4])
def test_triangles_are_the_surface_of_the_hull(size: float, flat: float) -> None:
    random = np.random.default_rng(3)
    inside = random.uniform(-0.4, 0.4, (30, 3))
    points = size * np.concatenate((inside, CUBE)) * (1.0, 1.0, flat) + size
    triangles = hull_triangles(points)
    assert set(triangles.ravel().tolist()) == set(range(30, 38))
    # Two triangles a side, each edge between two of them.
    edges = [frozenset(pair) for corners in triangles.tolist() for pair in combinations(corners, 2)]
    assert len(triangles) == 12
    assert all(edges.count(edge) == 2 for edge in edges)


@pytest.mark.parametrize(
    "cube", [lambda: hull(CUBE), lambda: box((1.0, 1.0, 1.0))], ids=["hull", "box"]
)
@pytest.mark.parametrize(
    ("other", "p", "distance"),
    [
        (lambda: box((1.0, 1.0, 1.0)), (1.3, 0.0, 0.0), 0.3),
        (lambda: box((1.0, 1.0, 1.0)), (1.3, 1.4, 0.0), 0.5),
        (lambda: cylinder(0.25, 2.0), (1.0, 0.0, 0.0), 0.25),
        (lambda: cylinder(0.25, 2.0), (0.0, 0.0, 1.7), 0.2),
        (lambda: hull(CUBE + 1.0), (0.0, 0.0, 0.1), 0.1),
    ],
)
def test_distances(
    cube: Callable[[], CollisionShape],
    other: Callable[[], CollisionShape],
    p: tuple[float, float, float],
    distance: float,
) -> None:
    assert measured(cube(), HERE, other(), at(*p)).distance == pytest.approx(distance, abs=1e-6)


@pytest.mark.parametrize("sides", [200, 400])
def test_hull_with_a_corner_of_many_edges_is_exact(sides: int) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = 0.02 * np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=1)
    cone = hull(np.concatenate((ring, [[0.0, 0.0, 0.06]])))
    wall = box((1.0, 1.0, 1.0))
    places = (0.6, 0.0, 0.0), (0.0, -0.6, 0.0), (0.0, 0.0, 0.6), (0.0, 0.0, -0.6)
    distances = [measured(wall, HERE, cone, at(*place)).distance for place in places]
    np.testing.assert_allclose(distances, (0.08, 0.08, 0.1, 0.04), rtol=0.0, atol=1e-8)


def test_shapes_have_the_given_poses() -> None:
    T = se3.from_rotation_translation(so3.rotation_z(np.pi / 4), (2.0, 0.0, 0.0))
    linkage = Linkage([RigidGroup(0, np.eye(4), np.array([0.0, 0.0, 1.0]), 0)])
    parts = [Part("turning", 1, (np.eye(4),), (hull(CUBE),)), obstacle("turned", T, hull(CUBE))]
    contact = CollisionWorld(linkage, parts, [(0, 1)]).nearest(np.zeros(1))
    assert contact is not None
    assert contact.distance == pytest.approx(1.5 - np.sqrt(0.5), abs=1e-6)


@pytest.mark.parametrize(
    "points",
    [CUBE[:, :2] @ np.eye(2, 3), CUBE[:3], np.zeros((9, 3)), np.full((4, 3), np.nan)],
    ids=["flat", "three", "one", "nan"],
)
def test_points_without_a_volume_are_refused(points: FloatArray) -> None:
    with pytest.raises(InputError):
        hull(points)


def test_sizes_must_be_above_zero() -> None:
    with pytest.raises(InputError, match="above 0"):
        box((1.0, 0.0, 1.0))
    with pytest.raises(InputError, match="above 0"):
        cylinder(-0.1, 1.0)
