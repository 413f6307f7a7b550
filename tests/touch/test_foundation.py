"""The elastic foundation against closed forms and against a much finer integration."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.solid import Solid
from katana450.extensions.touch.pad import (
    COLUMNS,
    ROWS,
    STIFFNESS,
    THICKNESS,
    Pad,
    pressed,
    surface_pad,
)
from katana450.extensions.touch.solid_body import SolidBody, body_of
from katana450.maths.geometry.arrays import FloatArray

LENGTH, WIDTH = 30e-3, 16e-3
RADIUS = 32e-3
ANGLES = np.pi / 8 * np.arange(1, 16, 2)
OCTAGON = 9e-3 / np.cos(np.pi / 8) * np.stack((np.cos(ANGLES), np.sin(ANGLES)), axis=1)
PRISM = np.array([(x, y, z) for x, y in OCTAGON for z in (0.0, 14e-3)])


@pytest.fixture(scope="module")
def flat() -> Pad:
    """A flat pad on y = 0 whose inner side is y < 0, from x = 0."""
    half = ((0.0, 0.0), (LENGTH / 2, 0.0)), ((LENGTH / 2, 0.0), (LENGTH, 0.0))
    return surface_pad("pad", half, WIDTH)


def thing(shape: Shape, *size: float) -> SceneObject:
    if shape is not Shape.MESH:
        return SceneObject("thing", shape, size, np.eye(4))
    solid = Solid("prism", (18e-3, 18e-3, 14e-3), PRISM)
    return SceneObject("thing", shape, solid.size, np.eye(4), solid=solid)


def fine_force(body: SolidBody, R: FloatArray, middle: FloatArray) -> float:
    """Return the force [N] on the flat pad by midpoints 0.05 mm apart."""
    x = (np.arange(600) + 0.5) * LENGTH / 600
    z = (np.arange(320) + 0.5) * WIDTH / 320 - 0.5 * WIDTH
    grid = np.stack(np.meshgrid(x, 0.0, z, indexing="ij"), axis=-1).reshape(-1, 3)
    depth = np.concatenate([body.depth((part - middle) @ R) for part in np.array_split(grid, 8)])
    area = LENGTH * WIDTH / len(grid)
    return float(STIFFNESS * np.clip(depth, 0.0, THICKNESS).sum() * area)


@pytest.mark.parametrize("depth", [0.5e-3, 0.7e-3, 1e-3, 1.5e-3, 2e-3])
@pytest.mark.parametrize("aside", [0.0, 0.31e-3, 1.4e-3])
def test_cylinder_on_plane_is_within_two_percent_of_the_closed_form(
    flat: Pad, depth: float, aside: float
) -> None:
    body = body_of(thing(Shape.CYLINDER, RADIUS, 0.09))
    middle = np.array((0.5 * LENGTH + aside, depth - RADIUS, 0.0))
    pressure = pressed(flat, body.depth(flat.points - middle))
    # The integral of the distance to the surface over the width of the contact, and its limit for
    # shallow contacts (Johnson, section 4.3).
    h = RADIUS - depth
    half_width = math.sqrt(RADIUS**2 - h**2)
    exact = STIFFNESS * WIDTH * (RADIUS * half_width - h**2 * math.asinh(half_width / h))
    shallow = STIFFNESS * WIDTH * 4.0 / 3.0 * depth * math.sqrt(2.0 * RADIUS * depth)
    assert pressure.force == pytest.approx(exact, rel=0.005)
    assert pressure.force == pytest.approx(shallow, rel=0.02 if depth < 1.8e-3 else 0.025)
    assert pressure.centre is not None
    np.testing.assert_allclose(pressure.centre, (0.5 * LENGTH + aside, 0.0), rtol=0, atol=2e-4)
    assert pressure.pressure.shape == (ROWS, COLUMNS)
    assert (pressure.pressure * flat.taxel_areas).sum() == pytest.approx(pressure.force)


@pytest.mark.parametrize("depth", [0.5e-3, 1.1e-3])
@pytest.mark.parametrize(
    ("shape", "size", "half"),
    [
        (Shape.SPHERE, (12e-3,), 12e-3),
        (Shape.BOX, (14e-3, 20e-3, 9e-3), 10e-3),
        (Shape.MESH, (), 9e-3),
    ],
)
def test_other_shapes_agree_with_a_fine_integration(
    flat: Pad, shape: Shape, size: tuple[float, ...], half: float, depth: float
) -> None:
    body = body_of(thing(shape, *size))
    angle = 0.05
    c, s = math.cos(angle), math.sin(angle)
    R = np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))
    middle = np.array((13.3e-3, depth - half, 0.7e-3))
    force = pressed(flat, body.depth((flat.points - middle) @ R)).force
    assert force == pytest.approx(fine_force(body, R, middle), rel=0.02)
    assert force > 0.05


def test_depth_stops_at_the_thickness_of_the_pad(flat: Pad) -> None:
    pressure = pressed(flat, np.full(len(flat.points), 1.0))
    assert pressure.force == pytest.approx(STIFFNESS * THICKNESS * LENGTH * WIDTH)


def test_untouched_pad_has_no_force_and_no_centre(flat: Pad) -> None:
    pressure = pressed(flat, np.full(len(flat.points), -1e-3))
    assert (pressure.force, pressure.centre) == (0.0, None)


def test_bodies_have_their_volume_and_depth() -> None:
    assert body_of(thing(Shape.BOX, 0.1, 0.2, 0.3)).volume == pytest.approx(0.006)
    assert body_of(thing(Shape.CYLINDER, 0.1, 0.2)).volume == pytest.approx(0.002 * math.pi)
    assert body_of(thing(Shape.SPHERE, 0.3)).volume == pytest.approx(0.036 * math.pi)
    prism = body_of(thing(Shape.MESH))
    assert prism.volume == pytest.approx(8 * 9e-3**2 * math.tan(math.pi / 8) * 14e-3)
    assert len(prism.normals) == 10
    places = np.array(((0.0, 0.0, -6e-3), (8e-3, 0.0, 0.0), (0.0, 10e-3, 0.0)))
    np.testing.assert_allclose(prism.depth(places), (1e-3, 1e-3, -1e-3), rtol=0, atol=1e-8)
