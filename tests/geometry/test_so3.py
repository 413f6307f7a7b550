from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from tests.geometry.strategies import points, repeatable, rotation_vectors

ROUNDING = 4e-15


@repeatable
@given(points, points)
def test_hat_is_the_cross_product_and_vee_undoes_it(w: FloatArray, p: FloatArray) -> None:
    np.testing.assert_allclose(so3.hat(w) @ p, np.cross(w, p), atol=1e-15)
    np.testing.assert_array_equal(so3.vee(so3.hat(w)), w)


@repeatable
@given(rotation_vectors)
def test_exp_is_a_rotation_about_its_vector(w: FloatArray) -> None:
    R = so3.exp(w)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=ROUNDING)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=ROUNDING)
    np.testing.assert_allclose(R @ w, w, atol=ROUNDING)
    np.testing.assert_allclose(so3.exp(-w), R.T, atol=ROUNDING)


@repeatable
@given(rotation_vectors)
def test_log_undoes_exp_near_zero_and_near_pi(w: FloatArray) -> None:
    back = so3.log(so3.exp(w))
    if np.linalg.norm(w) > math.pi - 1e-12:
        # At pi the opposite axis is also right.
        assert min(np.abs(back - w).max(), np.abs(back + w).max()) < 1e-11
    else:
        np.testing.assert_allclose(back, w, rtol=1e-13, atol=ROUNDING)
    assert np.linalg.norm(back) <= math.pi + 1e-15


@repeatable
@given(rotation_vectors, rotation_vectors)
def test_exp_of_a_log_is_the_rotation_again(a: FloatArray, b: FloatArray) -> None:
    R = so3.exp(a) @ so3.exp(b)
    np.testing.assert_allclose(so3.exp(so3.log(R)), R, atol=ROUNDING)


@pytest.mark.parametrize("exponent", [-13, -10, -7, -4, -1])
def test_angle_keeps_its_digits_at_both_ends(exponent: int) -> None:
    small = 10.0**exponent
    n = np.array([2.0, -3.0, 6.0]) / 7.0
    R0 = so3.exp([0.3, -0.4, 0.5])
    assert so3.angle(R0, R0 @ so3.exp(small * n)) == pytest.approx(small, abs=1e-15)
    large = math.pi - small
    assert so3.angle(R0, R0 @ so3.exp(large * n)) == pytest.approx(large, abs=2e-15)


@repeatable
@given(rotation_vectors)
def test_quaternion_and_back(w: FloatArray) -> None:
    R = so3.exp(w)
    q = so3.to_quaternion(R)
    assert q[0] >= 0.0
    assert math.hypot(*q) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(so3.from_quaternion(q), R, atol=ROUNDING)
    np.testing.assert_allclose(so3.from_quaternion(-7.0 * q), R, atol=ROUNDING)


def test_quaternion_of_a_known_rotation() -> None:
    np.testing.assert_allclose(
        so3.to_quaternion(so3.rotation_z(2.0)), [math.cos(1.0), 0.0, 0.0, math.sin(1.0)]
    )


@pytest.mark.parametrize("theta", [-2.5, 0.0, 1.2])
def test_rotations_about_the_axes_are_exponentials(theta: float) -> None:
    rotations = (so3.rotation_x, so3.rotation_y, so3.rotation_z)
    for rotation, axis in zip(rotations, np.eye(3), strict=True):
        np.testing.assert_allclose(rotation(theta), so3.exp(theta * axis), atol=1e-15)


half_turn = st.floats(-math.pi, math.pi)


@repeatable
@given(half_turn, st.floats(-1.57, 1.57), half_turn)
def test_rpy_are_fixed_axis_angles(roll: float, pitch: float, yaw: float) -> None:
    R = so3.from_rpy(roll, pitch, yaw)
    fixed = so3.exp([0, 0, yaw]) @ so3.exp([0, pitch, 0]) @ so3.exp([roll, 0, 0])
    np.testing.assert_allclose(R, fixed, atol=ROUNDING)
    np.testing.assert_allclose(so3.from_rpy(*so3.to_rpy(R)), R, atol=ROUNDING)
    got = so3.to_rpy(R)
    # Roll and yaw are compared on the circle; rounding in them grows as the pitch nears vertical.
    np.testing.assert_allclose(
        np.exp(1j * np.array(got)), np.exp(1j * np.array([roll, pitch, yaw])), atol=2e-11
    )


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_rpy_in_gimbal_lock_has_no_yaw(pitch: float) -> None:
    R = so3.from_rpy(0.4, pitch, 0.9)
    roll, got_pitch, yaw = so3.to_rpy(R)
    assert yaw == 0.0
    assert got_pitch == pytest.approx(pitch)
    np.testing.assert_allclose(so3.from_rpy(roll, got_pitch, yaw), R, atol=1e-15)


def test_validated_returns_the_nearest_rotation() -> None:
    R = so3.exp([0.3, -1.2, 2.0])
    noise = 1e-7 * np.random.default_rng(1).normal(size=(3, 3))
    got = so3.validated(R + noise)
    np.testing.assert_allclose(got.T @ got, np.eye(3), atol=1e-15)
    # To first order the nearest rotation differs by the skew part of the noise alone.
    skew = 0.5 * (R.T @ noise - noise.T @ R)
    np.testing.assert_allclose(got, R @ (np.eye(3) + skew), atol=1e-13)


@pytest.mark.parametrize(
    ("value", "word"),
    [
        (np.diag([1.0, 1.0, 1.001]), "not a rotation"),
        (np.diag([1.0, 1.0, -1.0]), "reflection"),
        (np.zeros((3, 3)), "not a rotation"),
        (np.eye(4), "shape"),
        (np.full((3, 3), np.nan), "nan"),
        (np.eye(3) * 1j, "complex"),
        ([["a"] * 3] * 3, "values"),
        ([[1.0], [1.0, 2.0]], "regular"),
        (None, "object"),
    ],
)
def test_invalid_rotation_is_refused(value: npt.ArrayLike, word: str) -> None:
    with pytest.raises(InputError, match=word):
        so3.validated(value)


@pytest.mark.parametrize("value", [[0.0] * 4, [1.0, 0.0, 0.0], [np.inf, 0.0, 0.0, 0.0]])
def test_invalid_quaternion_is_refused(value: list[float]) -> None:
    with pytest.raises(InputError, match="quaternion"):
        so3.from_quaternion(value)


@repeatable
@given(rotation_vectors, rotation_vectors)
def test_product_of_quaternions_is_the_product_of_rotations(a: FloatArray, b: FloatArray) -> None:
    A, B = so3.exp(a), so3.exp(b)
    product = so3.quaternion_product(so3.to_quaternion(A), so3.to_quaternion(B))
    np.testing.assert_allclose(so3.from_quaternion(product), A @ B, atol=ROUNDING)
    both = so3.quaternion_product(np.stack((product, [1.0, 0.0, 0.0, 0.0])), product)
    np.testing.assert_allclose(both[0], so3.quaternion_product(product, product), atol=0.0)
    np.testing.assert_allclose(both[1], product, atol=0.0)
