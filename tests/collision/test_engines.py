"""The distances of every engine against bounds that need no engine, and against each other."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import pytest

from katana450.maths.collision.contact import Witness
from katana450.maths.collision.engine import Engine
from katana450.maths.collision.nearest_points import Support, deepest, nearest_points, overlap
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray

fcl_engine = importlib.import_module("katana450.maths.collision.fcl_engine")
SAME = 1e-6  # m

SHAPES = ("hull", "round hull", "box", "cylinder", "sphere")
"""Kinds of geometries that are compared with each other."""

ROUND = {"cylinder", "sphere"}
"""Kinds for which coal does not find the shortest way out of an overlap."""


def built(engine: Engine, kind: str, random: np.random.Generator) -> Any:
    """Return a geometry of ``kind`` with sizes between 1 cm and 20 cm."""
    match kind:
        case "hull":
            return engine.hull(random.normal(size=(30, 3)) * random.uniform(0.01, 0.1, 3))
        case "round hull":
            points = random.normal(size=(300, 3))
            return engine.hull(0.07 * points / np.linalg.norm(points, axis=1, keepdims=True))
        case "box":
            return engine.box(random.uniform(0.02, 0.2, 3))
        case "cylinder":
            return engine.cylinder(*random.uniform(0.02, 0.1, 2))
    return engine.sphere(random.uniform(0.02, 0.1))


def poses(random: np.random.Generator, count: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield pairs of poses; in a quarter of them both are parallel and in line."""
    for number in range(count):
        one, other = np.eye(4), np.eye(4)
        way = random.normal(size=3)
        if number % 4:
            one[:3, :3], other[:3, :3] = so3.exp(random.normal(size=3)), so3.exp(way)
        else:
            way = np.eye(3)[number // 4 % 3]
        other[:3, 3] = way / np.linalg.norm(way) * random.uniform(0.01, 0.4)
        yield one, other


def measured(
    engine: Engine, one: Any, T_one: FloatArray, other: Any, T_other: FloatArray
) -> Witness:
    """Return the result of ``engine``, after comparing its two functions for a distance."""
    placed = one, engine.transform(T_one), other, engine.transform(T_other)
    found = engine.witness(*placed)
    assert engine.distance(*placed) == pytest.approx(found.distance, abs=1e-9)
    return found


@pytest.mark.parametrize("kinds", list(combinations_with_replacement(SHAPES, 2)), ids="-".join)
def test_fcl_measures_the_distances_of_coal(engine: Engine, kinds: tuple[str, str]) -> None:
    """Compare all results except overlaps of round bodies, of which the smaller depth is right."""
    if not isinstance(engine, fcl_engine.FclEngine):
        pytest.skip("compared once")
    pytest.importorskip("coal")
    coal = importlib.import_module("katana450.maths.collision.coal_engine").CoalEngine()
    random = np.random.default_rng(450)
    for T_one, T_other in poses(random, 60):
        seeds = random.integers(0, 2**32, 2)
        pairs = [
            tuple(
                built(each, kind, np.random.default_rng(seed))
                for kind, seed in zip(kinds, seeds, strict=True)
            )
            for each in (engine, coal)
        ]
        ours = measured(engine, pairs[0][0], T_one, pairs[0][1], T_other)
        theirs = measured(coal, pairs[1][0], T_one, pairs[1][1], T_other)
        if theirs.distance > 0.0 or not ROUND & set(kinds):
            assert ours.distance == pytest.approx(theirs.distance, abs=SAME)
        # Nearest points cannot be too near, nor can the depth of an overlap be too small.
        assert abs(ours.distance) <= abs(theirs.distance) + SAME
        assert (ours.distance > 0.0) == (theirs.distance > 0.0)
        np.testing.assert_allclose(
            ours.points[1] - ours.points[0], ours.distance * ours.normal, atol=SAME
        )


def test_distances_of_the_arm_are_on_their_bounds(
    world: CollisionWorld, postures: FloatArray
) -> None:
    """No body reaches beyond the plane across its nearest point, so no distance is too large."""
    points = hull_points(world)
    for x in postures[:10]:
        T = world.linkage.poses(x)
        placed = world.at(x)
        near, _ = placed.nearer_than(0.15)
        for pair in near.tolist():
            found = placed.contact(pair)
            one, other = (
                (points[body] @ T[world.mover_of[body]][:3, :3].T + T[world.mover_of[body]][:3, 3])
                if body in points
                else None
                for body in (int(world.first[pair]), int(world.second[pair]))
            )
            if one is None or other is None:
                continue
            bound = (other @ found.normal).min() - (one @ found.normal).max()
            assert abs(found.distance - bound) <= SAME


def hull_points(world: CollisionWorld) -> dict[int, FloatArray]:
    """Return the corners of the hulls of ``world``, in the frames of the groups."""
    shapes = [shape for part in world.parts for shape in part.shapes]
    found = {}
    for number, (shape, T) in enumerate(zip(shapes, world.T_mover_body, strict=True)):
        if shape.mark != b"half-space":
            corners = np.frombuffer(shape.mark).reshape(-1, 3)
            found[number] = corners @ T[:3, :3].T + T[:3, 3]
    return found


def cube(at: tuple[float, float, float]) -> Support:
    """Return the support mapping of a cube of 1 m about ``at``."""
    return lambda n: np.copysign(0.5, n) + at


@pytest.mark.parametrize(
    ("at", "distance"),
    [((1.3, 0.0, 0.0), 0.3), ((1.3, 1.4, 0.0), 0.5), ((2.0, 2.0, 2.0), np.sqrt(3.0))],
)
def test_nearest_points_of_cubes(at: tuple[float, float, float], distance: float) -> None:
    one, other = cube((0.0, 0.0, 0.0)), cube(at)
    points = nearest_points(one, other, np.array([0.1, -0.2, 1.0]))
    assert points is not None
    gap = points[1] - points[0]
    assert np.linalg.norm(gap) == pytest.approx(distance, abs=1e-9)
    assert -overlap(one, other, gap / distance) == pytest.approx(distance, abs=1e-9)


@pytest.mark.parametrize("depth", [0.0, 1e-7, 0.1, 0.4])
def test_depth_of_cubes(depth: float) -> None:
    one, other = cube((0.0, 0.0, 0.0)), cube((1.0 - depth, 0.2, -0.1))
    tilted = np.array([0.8, 0.6, 0.0])
    if depth:
        assert nearest_points(one, other, tilted) is None
    found = deepest(one, other, [tilted])
    assert found.distance == pytest.approx(-depth, abs=1e-8)
    np.testing.assert_allclose(found.normal, (1.0, 0.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(found.points[1] - found.points[0], -depth * found.normal, atol=1e-8)


def wrong_engine(distance: float) -> Callable[..., float]:
    """Return a substitute for FCL's ``distance`` [mm], with nearest points that far apart."""

    def measure(_one: Any, _other: Any, _request: Any, result: Any) -> float:
        result.nearest_points = [np.zeros(3), np.array([abs(distance), 0.0, 0.0])]
        return distance

    return measure


def failing(*_: Any) -> float:
    raise RuntimeError("FCL met a degenerate triangle.")


@pytest.mark.parametrize(
    "measure",
    [wrong_engine(314.0), wrong_engine(-3.0), wrong_engine(0.0), failing],
    ids=["far", "in", "on", "raises"],
)
@pytest.mark.parametrize("distance", [0.3, 1e-4, -0.1])
def test_wrong_results_of_fcl_are_repaired(
    measure: Callable[..., float], distance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fcl_engine.fcl, "distance", measure)
    T = np.eye(4)
    T[:3, 3] = (0.1, 1.0 + distance, 0.2)
    engine = fcl_engine.FclEngine()
    unit = engine.box(np.ones(3))
    found = measured(engine, unit, np.eye(4), unit, T)
    assert found.distance == pytest.approx(distance, abs=1e-8)
    np.testing.assert_allclose(found.normal, (0.0, 1.0, 0.0), atol=1e-6)
