"""Rigid motions: SE(3), its logarithm, and twists.

A pose T_a_b is a (4, 4) float64 matrix that maps coordinates of {b} into {a}; lengths in m, angles
in rad. A twist V (6,) is (omega, v): the angular part first. Source: Lynch & Park, Modern Robotics
(2017), ch. 3.3.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.errors import InputError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, finite_array

Rows = list[list[float]]
"""A matrix as nested lists of floats, which are faster than arrays for one pose at a time."""

# Looked up once: every call of the inverse kinematics uses these.
_ARRAY: Final = np.ndarray
_FLOAT: Final = np.dtype(np.float64)
_LAST_ROW: Final = [0.0, 0.0, 0.0, 1.0]
MISFITS_EXACT: Final = math.sqrt(6.0) * tolerances.ROTATION_EXACT
_FARTHEST: Final = tolerances.FARTHEST


def hat(V: npt.ArrayLike) -> FloatArray:
    """Return the (4, 4) matrix of the twist V = (omega, v) (6,)."""
    V = np.asarray(V, dtype=np.float64)
    X = np.zeros((4, 4))
    X[:3, :3] = so3.hat(V[:3])
    X[:3, 3] = V[3:]
    return X


def from_rotation_translation(R: npt.ArrayLike, p: npt.ArrayLike) -> FloatArray:
    """Return the pose with rotation `R` (3, 3) and position `p` (3,) [m]."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = p
    return T


def inverse(T: FloatArray) -> FloatArray:
    """Return the pose T_b_a for the pose T_a_b."""
    Rt = T[:3, :3].T
    return from_rotation_translation(Rt, -Rt @ T[:3, 3])


def adjoint(T: FloatArray) -> FloatArray:
    """Return the (6, 6) matrix that maps twists in {b} to twists in {a}, for the pose T_a_b."""
    A = np.zeros((6, 6))
    A[:3, :3] = A[3:, 3:] = T[:3, :3]
    A[3:, :3] = so3.hat(T[:3, 3]) @ T[:3, :3]
    return A


def log(T: FloatArray) -> FloatArray:
    """Return the twist V = (omega, v) (6,) with exp(hat(V)) == T and |omega| <= pi."""
    w = so3.log(T[:3, :3])
    p = T[:3, 3]
    theta = math.hypot(*w)
    square = theta * theta
    half = 0.5 * theta
    c = (1.0 - math.cos(half) / so3.sinc(half)) / square if square else 1.0 / 12.0
    W = so3.hat(w)
    Wp = W @ p
    return np.concatenate((w, p - 0.5 * Wp + c * (W @ Wp)))


def validated(T: npt.ArrayLike, name: str = "The pose") -> FloatArray:
    """Return a clean copy of the pose `T` (4, 4): the nearest rotation, last row exact.

    Raises InputError when `T` is not finite, has another shape, its last row is not 0 0 0 1, it is
    too far away to be computed with, or `so3.misfit` of its rotation exceeds ROTATION_INPUT.
    """
    if type(T) is _ARRAY and T.dtype is _FLOAT and T.shape == (4, 4) and _is_clean(T.tolist()):
        return T.copy()
    return np.array(validated_rows(T, name))


def validated_rows(T: npt.ArrayLike, name: str = "The pose") -> Rows:
    """Return the result of `validated` as nested lists of floats."""
    if type(T) is _ARRAY and T.dtype is _FLOAT and T.shape == (4, 4):
        rows: Rows = T.tolist()
        if _is_clean(rows):
            return rows
    M = finite_array(T, (4, 4), name)
    if np.abs(M[3] - (0.0, 0.0, 0.0, 1.0)).max() > tolerances.POSE_LAST_ROW:
        row = " ".join(f"{x:g}" for x in M[3])
        raise InputError(f"{name} has the last row {row}; a pose ends in 0 0 0 1.")
    if np.abs(M[:3, 3]).max() > tolerances.FARTHEST:
        raise InputError(
            f"{name} is {np.abs(M[:3, 3]).max():.2g} m away; give positions up to "
            f"{tolerances.FARTHEST:.0e} m."
        )
    # A name of one letter is a symbol and keeps its case.
    label = name if len(name) == 1 else name[:1].lower() + name[1:]
    R = so3.validated(M[:3, :3], f"The rotation of {label}")
    clean: Rows = from_rotation_translation(R, M[:3, 3]).tolist()
    return clean


def _is_clean(rows: Rows) -> bool:
    """Return True if the rows are a pose to within double precision.

    Uses plain floats, because every call of the inverse kinematics runs it. NaN fails every test.
    """
    (a, b, c, x), (d, e, f, y), (g, h, i, z), last = rows
    misfits = math.hypot(
        a * a + d * d + g * g - 1.0,
        b * b + e * e + h * h - 1.0,
        a * b + d * e + g * h,
        # The third axis is right-handed: its unit length and orthogonality follow.
        d * h - g * e - c,
        g * b - a * h - f,
        a * e - d * b - i,
    )
    return misfits <= MISFITS_EXACT and math.hypot(x, y, z) <= _FARTHEST and last == _LAST_ROW
