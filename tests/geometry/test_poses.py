"""Tests of rotations, poses and screw axes."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from katana450.errors import InputError
from katana450.maths.geometry import screws, se3, so3
from katana450.maths.geometry.arrays import FloatArray
from tests.geometry.strategies import (
    angles,
    directions,
    exp,
    points,
    repeatable,
    rotation_vectors,
    twists,
)


def test_a_twist_is_angular_part_first() -> None:
    T = exp([0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(T[:3, :3] @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    T = exp([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    np.testing.assert_array_equal(T, se3.from_rotation_translation(np.eye(3), [1.0, 2.0, 3.0]))


@repeatable
@given(twists)
def test_exp_is_the_matrix_exponential(V: FloatArray) -> None:
    # Scaling and squaring of the power series, which is independent of the formulas for rotations.
    X = se3.hat(V) / 1024.0
    term, expected = np.eye(4), np.eye(4)
    for k in range(1, 12):
        term = term @ X / k
        expected = expected + term
    for _ in range(10):
        expected = expected @ expected
    np.testing.assert_allclose(exp(V), expected, atol=2e-12)


@repeatable
@given(twists)
def test_log_undoes_exp(V: FloatArray) -> None:
    back = se3.log(exp(V))
    if np.linalg.norm(V[:3]) < math.pi - 1e-12:
        np.testing.assert_allclose(back, V, atol=4e-14)
    np.testing.assert_allclose(exp(back), exp(V), atol=2e-14)


@repeatable
@given(twists)
def test_inverse(V: FloatArray) -> None:
    T = exp(V)
    np.testing.assert_allclose(T @ se3.inverse(T), np.eye(4), atol=1e-14)
    np.testing.assert_allclose(se3.inverse(T), exp(-V), atol=1e-14)


@repeatable
@given(twists, twists)
def test_adjoint_carries_twists_between_frames(V: FloatArray, W: FloatArray) -> None:
    T = exp(V)
    moved = T @ se3.hat(W) @ se3.inverse(T)
    np.testing.assert_allclose(se3.hat(se3.adjoint(T) @ W), moved, atol=1e-13)


@repeatable
@given(rotation_vectors, points)
def test_validated_gives_a_clean_copy(w: FloatArray, p: FloatArray) -> None:
    T = se3.from_rotation_translation(so3.exp(w), p)
    rough = T.astype(np.float32)
    got = se3.validated(rough)
    np.testing.assert_allclose(got[:3, :3].T @ got[:3, :3], np.eye(3), atol=2e-15)
    np.testing.assert_array_equal(got[:3, 3], rough[:3, 3])
    np.testing.assert_array_equal(got[3], [0.0, 0.0, 0.0, 1.0])
    assert not np.shares_memory(got, rough)


def _with(row: int, column: int, value: float) -> FloatArray:
    T = np.eye(4)
    T[row, column] = value
    return T


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.eye(3), r"shape \(3, 3\)"),
        (_with(1, 3, np.nan), r"nan at \[1, 3\]"),
        (_with(0, 0, np.inf), r"inf at \[0, 0\]"),
        (_with(3, 0, 0.5), "last row 0.5 0 0 1"),
        (_with(3, 3, 2.0), "last row 0 0 0 2"),
        (_with(0, 0, 1.1), "not a rotation"),
        (_with(0, 0, 1e200), "not a rotation"),
        (_with(1, 3, -1.7e308), r"1\.7e\+308 m away; give positions up to 1e\+300 m"),
        (_with(2, 2, -1.0), "reflection"),
        ("pose", "shape|values"),
    ],
)
def test_invalid_pose_is_refused(value: npt.ArrayLike, words: str) -> None:
    with pytest.raises(InputError, match=words):
        se3.validated(value)


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


@repeatable
@given(directions, points, angles)
def test_a_revolute_screw_keeps_its_axis_and_turns_the_rest(
    omega: FloatArray, r: FloatArray, theta: float
) -> None:
    S = screws.revolute(3.0 * omega, r)
    assert screws.pitch(S) == pytest.approx(0.0, abs=1e-15)
    T = exp(S * theta)
    np.testing.assert_allclose(T[:3, :3] @ r + T[:3, 3], r, atol=1e-14)
    moved = r + np.cross(omega, [0.3, 0.5, -0.2])
    turned = T[:3, :3] @ moved + T[:3, 3]
    expected = r + np.cos(theta) * (moved - r) + np.sin(theta) * np.cross(omega, moved - r)
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
    T = exp(V)
    expected = screws.revolute(T[:3, :3] @ omega, T[:3, :3] @ r + T[:3, 3])
    np.testing.assert_allclose(screws.moved(T, screws.revolute(omega, r)), expected, atol=1e-13)


def test_an_axis_without_direction_is_refused() -> None:
    with pytest.raises(InputError, match="direction"):
        screws.revolute([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])
