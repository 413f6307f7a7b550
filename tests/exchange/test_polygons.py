"""Tests of the triangulation: triangles cover their polygon once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from katana450.extensions.importers.formats.surface import cut
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray


def areas(points: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the areas (m,) of the triangles of one polygon (k, 3), positive in its orientation."""
    triangles, polygon = cut(points, np.arange(len(points)), np.array([len(points)]))
    assert triangles.shape == (len(points) - 2, 3)
    assert not polygon.any()
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return np.asarray(np.cross(b - a, c - a) @ normal / 2.0)


def shoelace(flat: FloatArray) -> float:
    x, y = flat.T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2.0)


@settings(max_examples=60)
@given(
    st.lists(st.floats(0.1, 1.0), min_size=4, max_size=24),
    st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    st.booleans(),
)
def test_a_star_in_any_orientation_is_covered_once(
    radii: list[float], w: tuple[float, float, float], turned: bool
) -> None:
    angles = np.arange(len(radii)) * (2.0 * np.pi / len(radii))
    flat = np.column_stack((np.cos(angles), np.sin(angles))) * np.array(radii)[:, None]
    R = so3.exp(np.array(w))
    points = np.column_stack((flat, np.zeros(len(flat)))) @ R.T
    normal = R[:, 2]
    if turned:
        points, normal = points[::-1].copy(), -normal
    sizes = areas(points, normal)
    assert sizes.min() > -1e-12
    assert sizes.sum() == pytest.approx(shoelace(flat), rel=1e-9)


def test_a_hole_that_a_bridge_joins_stays_open() -> None:
    outer = [(0, 0), (4, 0), (4, 4), (0, 4)]
    hole = [(1, 1), (1, 3), (3, 3), (3, 1)]
    flat = np.array([*outer, outer[0], *hole, hole[0]], dtype=float)
    points = np.column_stack((flat, np.full(len(flat), 2.0)))
    sizes = areas(points, np.array((0.0, 0.0, 1.0)))
    assert sizes.min() >= 0.0
    assert sizes.sum() == pytest.approx(12.0)


def test_a_polygon_that_crosses_itself_gives_as_many_triangles() -> None:
    bow = np.array([[0, 0, 0], [1, 1, 0], [1, 0, 0], [0, 1, 0], [0.5, 3, 0]], dtype=float)
    assert len(areas(bow, np.array((0.0, 0.0, 1.0)))) == 3
    dot = np.zeros((6, 3))
    assert not areas(dot, np.array((0.0, 0.0, 1.0))).any()


def test_polygons_of_any_size_keep_their_order() -> None:
    points = np.random.default_rng(1).normal(size=(20, 3))
    sizes = np.array([3, 5, 0, 2, 4, 3])
    triangles, polygon = cut(points, np.arange(17), sizes)
    assert polygon.tolist() == [0, 1, 1, 1, 4, 4, 5]
    assert sorted({*triangles[polygon == 4].ravel().tolist()}) == [10, 11, 12, 13]
