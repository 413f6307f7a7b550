from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given

from katana450.errors import InputError
from katana450.maths.geometry import screws, se3
from katana450.maths.geometry.arrays import FloatArray
from tests.geometry.strategies import angles, directions, points, repeatable, twists


@repeatable
@given(directions, points, angles)
def test_a_revolute_screw_keeps_its_axis_and_turns_the_rest(
    omega: FloatArray, r: FloatArray, theta: float
) -> None:
    S = screws.revolute(3.0 * omega, r)
    assert screws.pitch(S) == pytest.approx(0.0, abs=1e-15)
    T = se3.exp(S * theta)
    np.testing.assert_allclose(T[:3, :3] @ r + T[:3, 3], r, atol=1e-14)
    beside = r + np.cross(omega, [0.3, 0.5, -0.2])
    turned = T[:3, :3] @ beside + T[:3, 3]
    expected = r + np.cos(theta) * (beside - r) + np.sin(theta) * np.cross(omega, beside - r)
    np.testing.assert_allclose(turned, expected, atol=1e-14)


@repeatable
@given(directions, points)
def test_point_on_is_the_foot_of_the_origin(omega: FloatArray, r: FloatArray) -> None:
    foot = screws.point_on(screws.revolute(omega, r))
    assert foot @ omega == pytest.approx(0.0, abs=1e-14)
    np.testing.assert_allclose(np.cross(foot - r, omega), 0.0, atol=1e-14)


@repeatable
@given(directions, points, twists)
def test_moved_is_the_axis_of_the_moved_point_and_direction(
    omega: FloatArray, r: FloatArray, V: FloatArray
) -> None:
    T = se3.exp(V)
    expected = screws.revolute(T[:3, :3] @ omega, T[:3, :3] @ r + T[:3, 3])
    np.testing.assert_allclose(screws.moved(T, screws.revolute(omega, r)), expected, atol=1e-13)


def test_pitch_of_a_screw_motion() -> None:
    assert screws.pitch(np.array([0.0, 0.0, 1.0, 0.4, 0.0, 0.02])) == 0.02


def test_an_axis_without_direction_is_refused() -> None:
    with pytest.raises(InputError, match="direction"):
        screws.revolute([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])
