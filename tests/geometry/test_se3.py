from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given

from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from tests.geometry.strategies import points, repeatable, rotation_vectors, twists


def test_a_twist_is_angular_part_first() -> None:
    T = se3.exp([0.0, 0.0, math.pi / 2, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(T[:3, :3] @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    T = se3.exp([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    np.testing.assert_array_equal(T, se3.from_rotation_translation(np.eye(3), [1.0, 2.0, 3.0]))


@repeatable
@given(twists)
def test_vee_undoes_hat(V: FloatArray) -> None:
    np.testing.assert_array_equal(se3.vee(se3.hat(V)), V)


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
    np.testing.assert_allclose(se3.exp(V), expected, atol=2e-12)


@repeatable
@given(twists)
def test_log_undoes_exp(V: FloatArray) -> None:
    back = se3.log(se3.exp(V))
    if np.linalg.norm(V[:3]) < math.pi - 1e-12:
        np.testing.assert_allclose(back, V, atol=4e-14)
    np.testing.assert_allclose(se3.exp(back), se3.exp(V), atol=2e-14)


@repeatable
@given(twists)
def test_inverse(V: FloatArray) -> None:
    T = se3.exp(V)
    np.testing.assert_allclose(T @ se3.inverse(T), np.eye(4), atol=1e-14)
    np.testing.assert_allclose(se3.inverse(T), se3.exp(-V), atol=1e-14)


@repeatable
@given(twists, twists)
def test_adjoint_carries_twists_between_frames(V: FloatArray, W: FloatArray) -> None:
    T = se3.exp(V)
    moved = T @ se3.hat(W) @ se3.inverse(T)
    np.testing.assert_allclose(se3.hat(se3.adjoint(T) @ W), moved, atol=1e-13)


@repeatable
@given(twists, twists)
def test_adjoint_is_a_homomorphism(V: FloatArray, W: FloatArray) -> None:
    Ta, Tb = se3.exp(V), se3.exp(W)
    np.testing.assert_allclose(se3.adjoint(Ta @ Tb), se3.adjoint(Ta) @ se3.adjoint(Tb), atol=1e-13)


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
