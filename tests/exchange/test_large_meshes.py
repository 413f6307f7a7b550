"""Test meshes with more triangles than are drawn: coarser, as large, with the hull of the whole."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.extensions.convex_body import convex_body
from katana450.extensions.importers import reading
from katana450.extensions.importers.guarded_reading import read_shape_guarded
from katana450.extensions.importers.reading import answer, drawn
from katana450.extensions.importers.shape_file import Format, Up, read_shape
from katana450.extensions.importers.surface import MAX_DRAWN, MeshSurface, coarser
from katana450.maths.geometry.arrays import FloatArray
from tests.exchange.solids import volume
from tests.exchange.test_reading_time import soup

SPHERES = """#VRML V2.0 utf8
DEF Row Group { children [ %s ] }
%s
"""


def spheres(rows: int, each: int) -> bytes:
    """Return a world of rows of spheres, of 960 triangles each; the first one is red."""
    ball = (
        "Transform { translation %d 0 0 children Shape { geometry DEF S%d Sphere { radius 1 } "
        "appearance Appearance { material Material { diffuseColor %s } } } }"
    )
    balls = [ball % (4 * n, n, "0 0 1" if n else "1 0 0") for n in range(each)]
    used = [f"Transform {{ translation 0 {4 * n} 0 children USE Row }}" for n in range(1, rows)]
    return (SPHERES % (" ".join(balls), " ".join(used))).encode()


def wave(count: int) -> MeshSurface:
    """Return a square of 1 m with waves of 0.1 m, of 2 count^2 triangles, half of them red."""
    x, y = np.meshgrid(np.linspace(0.0, 1.0, count + 1), np.linspace(0.0, 1.0, count + 1))
    z = 0.1 * np.sin(10.0 * x) * np.sin(10.0 * y)
    first = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).ravel()
    a, b, c, d = first, first + 1, first + count + 2, first + count + 1
    faces = np.concatenate((np.column_stack((a, b, c)), np.column_stack((a, c, d))))
    left = x.ravel()[faces].mean(axis=1) < 0.5
    colours = np.where(left[:, None], (255, 0, 0, 255), (0, 0, 255, 255)).astype(np.uint8)
    return MeshSurface(np.column_stack((x.ravel(), y.ravel(), z.ravel())), faces, colours)


def test_a_surface_keeps_its_place_its_extent_and_its_colours() -> None:
    whole = wave(100)
    found, moved = coarser(whole, 5000)
    assert 2500 < len(found.faces) <= 5000
    assert found.vertices.min(axis=0) == pytest.approx(whole.vertices.min(axis=0), abs=1e-12)
    assert found.vertices.max(axis=0) == pytest.approx(whole.vertices.max(axis=0), abs=1e-12)
    # Cells are about twice as long as an edge of 10 mm.
    assert 5e-3 < moved < 0.04
    x, y, z = found.vertices.T
    assert np.abs(z - 0.1 * np.sin(10.0 * x) * np.sin(10.0 * y)).max() < 0.03
    assert found.colours is not None
    middle = found.vertices[found.faces][:, :, 0].mean(axis=1)
    red = found.colours[:, 0] == 255
    assert middle[red].max() < 0.54
    assert middle[~red].min() > 0.46
    # The triangles still face upwards; the corners of a few get into one line.
    a, b, c = np.moveaxis(found.vertices[found.faces], 1, 0)
    upwards = np.cross(b - a, c - a)[:, 2]
    assert (upwards > -1e-12).all()
    assert (upwards > 1e-9).mean() > 0.99


@pytest.mark.parametrize("maximum", [1, 10, 100, 10_000])
def test_any_maximum_is_kept(maximum: int) -> None:
    flat: FloatArray = np.array(soup(5000), dtype=np.float64)
    for corners in (flat, flat * (1.0, 1e-9, 1.0), flat * 1e20, flat * 1e-20):
        whole = MeshSurface(corners.reshape(-1, 3), np.arange(len(corners) * 3).reshape(-1, 3))
        found, _ = coarser(whole.tidy(), maximum)
        assert len(found.faces) <= maximum


def test_few_large_triangles_beside_many_small_ones_are_merged() -> None:
    small, large = (np.asarray(soup(3000)) * size for size in (1e-6, 1e-1))
    corners = np.concatenate((small, large * 1e3))
    whole = MeshSurface(corners.reshape(-1, 3), np.arange(len(corners) * 3).reshape(-1, 3))
    found, _ = coarser(whole, 2000)
    assert 0 < len(found.faces) <= 2000


def test_a_solid_stays_closed_in_volume() -> None:
    shape = read_shape(spheres(1, 1), Format.WRL, "a.wrl", 1e-2, Up.Z)
    whole = MeshSurface(shape.vertices, shape.faces)
    found, moved = coarser(whole, 600)
    assert len(found.faces) <= 600
    smaller = MeshSurface(found.vertices, found.faces)
    a, b, c = np.moveaxis(smaller.vertices[smaller.faces], 1, 0)
    assert np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0 == pytest.approx(
        volume(shape), rel=0.1
    )
    assert moved < 4e-3


def test_the_answer_has_a_coarser_mesh_and_the_hull_of_the_whole(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    data = spheres(2, 3)
    whole = read_shape(data, Format.WRL, "a.wrl", 1e-2, Up.Z)
    assert len(whole.faces) == 6 * 960
    assert drawn(whole) is whole
    monkeypatch.setattr(reading, "MAX_DRAWN", 2000)
    found = answer(data, Format.WRL, "a.wrl", 1e-2, Up.Z, "")
    assert found.shape is not None
    assert found.body is not None
    faces, text = found.shape.faces, found.shape.text
    assert 1000 < len(faces) <= 2000
    assert found.shape.colours is not None
    assert len(found.shape.colours) == len(faces)
    assert text.startswith("5760 triangles, 100 × 60 × 20 mm")
    assert f"It is drawn with {len(faces)} triangles, whose corners are up to" in text
    body = convex_body(whole.vertices)
    np.testing.assert_array_equal(found.body.corners, body.corners)


@pytest.mark.long
def test_a_large_world_is_read_in_its_subprocess() -> None:
    shape, body = read_shape_guarded(spheres(20, 11), Format.WRL, "many.wrl", 1e-2)
    assert MAX_DRAWN // 2 < len(shape.faces) <= MAX_DRAWN
    assert shape.text.startswith("211200 triangles")
    assert body.volume > 0.0
