"""Cup, basin and table: the files, their sizes, and the data file."""

from __future__ import annotations

import functools
import json
import math
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from katana450.resources import PROPS_PATH
from robot_description.cad.props import PARTS
from robot_description.cad.solid import rod

TRIANGLE_BUDGET = 8_000
BYTE_BUDGET = 160_000
REACH = 0.634  # m, from the shoulder's axis to the finger tips
PAYLOAD = 0.4  # kg


@functools.cache
def data() -> dict[str, Any]:
    props: dict[str, Any] = json.loads(PROPS_PATH.read_text("utf-8"))
    return props


def prop(name: str) -> trimesh.Scene:
    scene = trimesh.load(PROPS_PATH.parent / data()[name]["mesh"], process=False)
    assert isinstance(scene, trimesh.Scene)
    return scene


def whole(name: str) -> Manifold:
    part = next(make() for make in PARTS if make.__name__ == name)
    return functools.reduce(lambda a, b: a + b, (body for _, body in part.bodies()))


def test_triangles_and_bytes_are_in_budget() -> None:
    files = list(PROPS_PATH.parent.glob("*.glb"))
    assert {path.stem for path in files} == set(data()) - {"about"}
    meshes = [mesh for path in files for mesh in prop(path.stem).geometry.values()]
    assert sum(len(mesh.faces) for mesh in meshes) <= TRIANGLE_BUDGET
    assert sum(path.stat().st_size for path in files) <= BYTE_BUDGET


def test_cup_and_basin_stand_on_the_table_with_the_sizes_given() -> None:
    for name in ("cup", "basin"):
        low, high = prop(name).bounds
        size = data()[name]
        radius = size["outer_radius"]
        np.testing.assert_allclose(low, (-radius, -radius, 0.0), atol=3e-4)
        np.testing.assert_allclose(high, (radius, radius, size["height"]), atol=3e-4)


def test_table_is_flat_at_zero_and_holds_the_whole_reach() -> None:
    table = data()["table"]
    low, high = prop("table").bounds
    np.testing.assert_allclose(low, (table["x"][0], table["y"][0], -table["thickness"]), atol=1e-6)
    np.testing.assert_allclose(high, (table["x"][1], table["y"][1], 0.0), atol=1e-6)
    assert table["x"][1] > REACH
    assert min(-table["y"][0], table["y"][1]) > REACH
    rim = 0.121  # radius of the control box's flange
    assert -table["x"][0] > rim


def test_cup_holds_what_a_straight_cylinder_does() -> None:
    size = data()["cup"]
    inside = rod(2e3 * size["inner_radius"], 1e3 * size["floor"], 1e3 * size["height"])
    water = inside - whole("cup")
    radius, depth = size["inner_radius"], size["height"] - size["floor"]
    assert water.volume() * 1e-9 == pytest.approx(math.pi * radius**2 * depth, rel=0.02)
    assert (inside ^ whole("cup")).volume() < 500.0  # mm^3, the fillet round the floor
    full = size["mass"] + 1000.0 * math.pi * radius**2 * depth
    assert full < PAYLOAD


def test_basin_takes_the_cups_water_many_times() -> None:
    size = data()["basin"]
    hull = whole("basin").hull()
    below_rim = hull ^ rod(2e3 * size["outer_radius"], 0.0, 1e3 * size["height"] - 8.0)
    assert (below_rim - whole("basin")).volume() > 4 * 246e3  # mm^3
    assert size["inner_radius"] > 3 * data()["cup"]["outer_radius"]


@pytest.mark.parametrize("make", PARTS, ids=lambda make: make.__name__)
def test_each_prop_is_connected(make: Any) -> None:
    assert len(whole(make.__name__).decompose()) == 1
