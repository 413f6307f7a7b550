from __future__ import annotations

import numpy as np
from hypothesis import given

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water import vectors
from tests.geometry.strategies import directions, points, repeatable


@repeatable
@given(points, points)
def test_vectors_agree_with_numpy(a: FloatArray, b: FloatArray) -> None:
    u, v = vectors.vector(a), vectors.vector(b)
    np.testing.assert_array_equal(vectors.add(u, v), a + b)
    np.testing.assert_array_equal(vectors.sub(u, v), a - b)
    np.testing.assert_array_equal(vectors.scale(2.5, u), 2.5 * a)
    np.testing.assert_allclose(vectors.dot(u, v), a @ b, atol=1e-14)
    np.testing.assert_allclose(vectors.cross(u, v), np.cross(a, b), atol=1e-14)
    np.testing.assert_allclose(vectors.norm(u), np.linalg.norm(a), rtol=1e-15)


@repeatable
@given(points, directions)
def test_perpendicular_removes_the_part_along_the_axis(a: FloatArray, omega: FloatArray) -> None:
    left = np.array(vectors.perpendicular(vectors.vector(a), vectors.vector(omega)))
    np.testing.assert_allclose(left @ omega, 0.0, atol=1e-14)
    np.testing.assert_allclose(np.cross(a - left, omega), 0.0, atol=1e-14)
