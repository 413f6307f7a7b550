"""Tests of camera rays against a projection matrix."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.extensions.media.picture import Camera

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
