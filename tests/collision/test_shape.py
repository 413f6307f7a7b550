"""Convex shapes against known sizes."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest

from katana450.errors import InputError
from katana450.maths.collision.linkage import Linkage, RigidGroup
from katana450.maths.collision.shape import CollisionShape, box, cylinder, half_space, hull
from katana450.maths.collision.world import CollisionWorld, Part, obstacle
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray

CUBE = np.array(list(product((-0.5, 0.5), repeat=3)))


def apart(one: CollisionShape, other: CollisionShape, p: tuple[float, float, float]) -> float:
    """Return the distance between two shapes, the second at ``p`` [m] on a joint at zero."""
    T = se3.from_rotation_translation(np.eye(3), p)
    linkage = Linkage([RigidGroup(0, T, np.array([0.0, 0.0, 1.0]), 0)])
    parts = [obstacle("one", np.eye(4), one), Part("other", 1, (np.eye(4),), (other,))]
    contact = CollisionWorld(linkage, parts, [(0, 1)]).nearest(np.zeros(1))
    assert contact is not None
    assert contact.parts == ("one", "other")
    assert np.linalg.norm(contact.normal) == pytest.approx(1.0)
    np.testing.assert_allclose(
        contact.points[1] - contact.points[0], contact.distance * contact.normal, atol=1e-6
    )
    return contact.distance


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
    assert apart(cube(), other(), p) == pytest.approx(distance, abs=1e-6)


@pytest.mark.parametrize("sides", [200, 400])
def test_hull_with_a_corner_of_many_edges_is_exact(sides: int) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = 0.02 * np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=1)
    cone = hull(np.concatenate((ring, [[0.0, 0.0, 0.06]])))
    wall = box((1.0, 1.0, 1.0))
    distances = [apart(wall, cone, p) for p in ((0.6, 0.0, 0.0), (0.0, -0.6, 0.0), (0.0, 0.0, 0.6))]
    np.testing.assert_allclose(distances, (0.08, 0.08, 0.1), rtol=0.0, atol=1e-8)
    assert apart(wall, cone, (0.0, 0.0, -0.6)) == pytest.approx(0.04, abs=1e-8)


def test_overlapping_shapes_have_a_depth() -> None:
    assert apart(hull(CUBE), hull(CUBE), (0.9, 0.0, 0.0)) == pytest.approx(-0.1, abs=1e-5)


@pytest.mark.parametrize("side", [0.0, 0.7, -2.0])
def test_half_space_is_flat_and_infinite(side: float) -> None:
    assert apart(half_space(), hull(CUBE), (side, -side, 0.6)) == pytest.approx(0.1, abs=1e-9)
    assert apart(half_space(), hull(CUBE), (side, 0.0, 0.45)) == pytest.approx(-0.05, abs=1e-6)


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
