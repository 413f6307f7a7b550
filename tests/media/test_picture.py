"""Tests of pictures: reproducible, with every item at its place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.robot.initial_camera import FIELD_OF_VIEW, camera
from katana450.arm.robot.initial_camera import InitialCamera as Viewpoint
from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.extensions.media.picture import (
    FLOOR,
    NOWHERE,
    Camera,
    Item,
    Pixels,
    RenderScene,
    Tracer,
    Translucent,
    first_hits,
    hits_behind,
    picture,
    png,
)
from katana450.extensions.media.report_pictures import tube
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import IntArray
from katana450.resources import URDF_PATH
from katana450.server.viser_bridge.themes import FLOOR_AT
from tests.exchange.conftest import POSES
from tests.exchange.silhouette import SIZE, overlap, placed, silhouette
from tests.media.conftest import Workshop

NEAR = Camera((0.98, 0.52, 0.62), (0.22, 0.06, 0.14), math.radians(40.0), (320, 200))
"""View of cup, basin and hand."""

UP = se3.from_rotation_translation(np.eye(3), (0.0, 0.0, 0.5))


@pytest.fixture(scope="module")
def katana() -> Robot:
    return load(URDF_PATH)


@pytest.fixture(scope="module")
def filled(workshop: Workshop) -> Pixels:
    state = workshop.filled
    return picture(workshop.stage.items(state), workshop.stage.water(state), NEAR)


def seen(
    items: Sequence[Item], camera: Camera, translucents: Sequence[Translucent] = ()
) -> IntArray:
    """Return (height, width) the number of the item at the middle of each pixel.

    Those of translucent items follow those of the others.
    """
    width, height = camera.size
    y, x = np.mgrid[0.5:height, 0.5:width].reshape(2, -1).astype(np.float32)
    eye = np.array(camera.position, dtype=np.float32)
    hits = first_hits(Tracer(RenderScene.of(items)), eye, camera.directions(x, y), FLOOR_AT)
    numbers = hits.item.astype(np.int64)
    if translucents:
        thin = Tracer(RenderScene.of([translucent.item for translucent in translucents]))
        which, surface = hits_behind(thin, eye, hits)
        numbers[which] = surface.item + len(items)
    return numbers.reshape(height, width)


def ball(radius: float) -> VisualMesh:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    normals = np.asarray(mesh.vertices) / radius
    return VisualMesh(
        Material("red", (0.8, 0.1, 0.1)), mesh.vertices, normals, np.asarray(mesh.faces)
    )


def test_the_same_scene_gives_the_same_bytes(workshop: Workshop, filled: Pixels) -> None:
    state = workshop.filled
    again = picture(workshop.stage.items(state), workshop.stage.water(state), NEAR)
    assert png(again) == png(filled)


@pytest.mark.cases(2)
@pytest.mark.parametrize("pose", POSES)
def test_the_arm_covers_the_same_pixels_as_in_pillow(
    workshop: Workshop, katana: Robot, pose: tuple[float, ...]
) -> None:
    """Compare with a projection by other programs, of meshes that other programs read and pose."""
    view: Viewpoint = camera(katana)
    pinhole = Camera(tuple(view.eye), tuple(view.target), FIELD_OF_VIEW, (SIZE, SIZE))
    scene = RenderScene.of(
        workshop.stage.arm(workshop.session.begin(np.array(pose[:5]), pose[5], 0.0))
    )
    # Rays through the middle of each pixel, as in a picture, but without light.
    y, x = np.mgrid[0.5:SIZE, 0.5:SIZE].reshape(2, -1).astype(np.float32)
    eye = np.array(pinhole.position, dtype=np.float32)
    hits = first_hits(Tracer(scene), eye, pinhole.directions(x, y), -10.0)
    theirs = silhouette(placed(URDF_PATH, katana.values(pose)), view)
    assert overlap((hits.item >= 0).reshape(SIZE, SIZE), theirs) >= 0.98


def test_cup_and_water_are_seen(workshop: Workshop, filled: Pixels) -> None:
    stage, state = workshop.stage, workshop.filled
    items, place = stage.items(state), [thing.name for thing in state.objects].index("cup")
    first, end = (
        len(stage.items(replace(state, objects=state.objects[:count])))
        for count in (place, place + 1)
    )
    numbers = seen(items, NEAR, stage.water(state))
    cup, water = (numbers >= first) & (numbers < end), numbers == len(items)
    assert cup.sum() > 300
    assert 20 < water.sum() < cup.sum()
    dry = picture(stage.items(workshop.ready), (), NEAR)
    wet, white = filled[water].astype(float), dry[water].astype(float)
    # Water absorbs red of the white cup.
    assert (wet[:, 2] - wet[:, 0]).mean() > (white[:, 2] - white[:, 0]).mean() + 20.0
    same = ~water & (numbers == seen(stage.items(workshop.ready), NEAR))
    assert (filled[same] == dry[same]).mean() > 0.99


def test_an_uploaded_object_is_seen_at_its_place(workshop: Workshop) -> None:
    T = se3.from_rotation_translation(np.eye(3), (0.4, 0.0, 0.0))
    box = SceneObject("crate", Shape.BOX, (0.1, 0.1, 0.1), T)
    state = replace(workshop.ready, objects=(box,))
    items = workshop.stage.surrounding_items(state)
    crate = seen(items, NEAR) == len(items) - 1
    without = picture(items[:-1], (), NEAR)
    assert (picture(items, (), NEAR) != without).any(axis=2)[crate].mean() > 0.95
    where = np.argwhere(crate).mean(axis=0)
    away = np.array((0.4, 0.0, 0.05)) - NEAR.position
    right, up, distance = NEAR.frame @ away / NEAR.pixel
    depth = NEAR.frame[2] @ away
    assert where[1] == pytest.approx(160.0 + right / depth, abs=3.0)
    assert where[0] == pytest.approx(100.0 - up / depth, abs=3.0)
    assert distance > 0.0


def test_a_sphere_has_the_size_of_its_projection() -> None:
    """A distant sphere covers a disc with the sine of its half angle as radius."""
    camera = Camera((2.0, 0.0, 0.5), (0.0, 0.0, 0.5), math.radians(30.0), (300, 300))
    # The ball alone is red.
    red, _, blue = picture([Item(ball(0.3), UP)], (), camera).astype(int).transpose(2, 0, 1)
    radius = math.tan(math.asin(0.3 / 2.0)) / camera.pixel
    assert (red - blue > 20).sum() == pytest.approx(math.pi * radius**2, rel=0.01)


def test_a_shadow_falls_along_the_key_light() -> None:
    """The shadow of a sphere 0.5 m up lies along the light's direction from its centre."""
    camera = Camera((0.0, -2.5, 2.5), (0.0, 0.0, 0.0), math.radians(50.0), (200, 200))
    items = [Item(ball(0.15), UP)]
    with_ball, without = picture(items, (), camera), picture((), (), camera)
    darker = without.astype(int).sum(axis=2) - with_ball.astype(int).sum(axis=2)
    shadow = (darker > 60) & (seen(items, camera) == FLOOR)
    key = np.array((0.7, -0.9, 1.9))
    foot = np.array((0.0, 0.0, 0.5)) - key * (0.5 + 0.0255) / key[2]
    right, up, depth = camera.frame @ (foot - camera.position)
    row, column = np.argwhere(shadow).mean(axis=0)
    assert column == pytest.approx(100.0 + right / depth / camera.pixel, abs=2.0)
    assert row == pytest.approx(100.0 - up / depth / camera.pixel, abs=2.0)


def test_edges_are_smooth() -> None:
    """Pixels between a dark sphere and the bright room have intermediate colours."""
    camera = Camera((2.0, 0.0, 0.5), (0.0, 0.0, 0.5), math.radians(30.0), (200, 200))
    row = picture([Item(ball(0.3), UP)], (), camera)[:, :, 1].astype(int)
    inside, outside = row[100, 100], row[100, 5]
    # A nearly vertical outline crosses pixels at another place in each row.
    rim = row[70:130, 10:60]
    assert ((rim > inside + 15) & (rim < outside - 15)).any(axis=1).mean() > 0.7


def test_an_empty_picture_is_the_room() -> None:
    camera = Camera((2.0, 0.0, 0.5), (0.0, 0.0, 0.5), math.radians(30.0), (64, 48))
    assert set(np.unique(seen((), camera))) == {FLOOR, NOWHERE}
    assert picture((), (), camera).shape == (48, 64, 3)


def test_a_line_is_a_tube_of_its_length() -> None:
    turn = np.linspace(0.0, math.tau, 200)
    circle = np.stack((np.cos(turn), np.sin(turn), np.zeros(200)), axis=1)
    item = tube("line", circle, 0.01, (10, 160, 80))
    assert item is not None
    corners = item.shape.vertices
    away = np.linalg.norm(corners - _nearest(corners), axis=1)
    # Corners of ends are on the axis.
    assert away.max() == pytest.approx(0.01, rel=0.01)
    mesh = trimesh.Trimesh(corners, item.shape.faces, process=False)
    parts = mesh.split(only_watertight=True)
    assert len(parts) == 199
    assert sum(part.volume for part in parts) == pytest.approx(
        math.tau * 4.0 * 0.01**2 * math.sin(math.tau / 8), rel=0.01
    )
    assert tube("dot", np.zeros((5, 3)), 0.01, (0, 0, 0)) is None


def _nearest(points: np.typing.NDArray[np.float64]) -> np.typing.NDArray[np.float64]:
    """Return the nearest point on the unit circle."""
    flat = points * (1.0, 1.0, 0.0)
    return np.asarray(flat / np.linalg.norm(flat, axis=1, keepdims=True))


spot = st.floats(-2.0, 2.0)


@given(
    st.tuples(spot, spot, spot),
    st.floats(0.0, 639.0),
    st.floats(0.0, 399.0),
    st.floats(0.2, 2.0),
)
def test_a_ray_passes_through_the_point_projected_to_its_pixel(
    eye: tuple[float, float, float], x: float, y: float, fov: float
) -> None:
    camera = Camera(eye, (eye[0] - 1.0, eye[1] + 0.5, eye[2] - 0.3), fov, (640, 400))
    (way,) = camera.directions(np.array([x], dtype=np.float32), np.array([y], dtype=np.float32))
    assert np.linalg.norm(way) == pytest.approx(1.0, abs=1e-6)
    # Projection matrix from the vectors of the camera.
    axis = np.array((-1.0, 0.5, -0.3)) / math.sqrt(1.34)
    right = np.cross(axis, (0.0, 0.0, 1.0)) / math.hypot(*axis[:2])
    down = np.cross(axis, right)
    scale = 200.0 / math.tan(0.5 * fov) / (way @ axis)
    assert 320.0 + scale * (way @ right) == pytest.approx(x, abs=0.01)
    assert 200.0 + scale * (way @ down) == pytest.approx(y, abs=0.01)
