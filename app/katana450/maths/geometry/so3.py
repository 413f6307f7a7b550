"""Rotations in space: SO(3), its exponential and logarithm, and its usual coordinates.

Rotation matrices are (3, 3) float64, angles in rad. Sources: Lynch & Park, Modern Robotics (2017),
ch. 3.2; Murray, Li & Sastry (1994), ch. 2.2.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array


def hat(w: npt.ArrayLike) -> FloatArray:
    """Return the (3, 3) skew matrix W of `w` (3,): W @ p == cross(w, p)."""
    x, y, z = (float(c) for c in np.asarray(w))
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def vee(W: FloatArray) -> FloatArray:
    """Return the vector (3,) of the skew part of `W` (3, 3): the inverse of `hat`."""
    return 0.5 * np.array([W[2, 1] - W[1, 2], W[0, 2] - W[2, 0], W[1, 0] - W[0, 1]])


def sinc(x: float) -> float:
    """Return sin(x) / x, and its limit 1 at 0."""
    return math.sin(x) / x if x else 1.0


def exp(w: npt.ArrayLike) -> FloatArray:
    """Return the rotation by |w| [rad] about w (3,), exact to rounding also near 0.

    Uses Rodrigues' formula.
    """
    x, y, z = (float(c) for c in np.asarray(w))
    theta = math.hypot(x, y, z)
    a = sinc(theta)
    b = 0.5 * sinc(0.5 * theta) ** 2
    xy, xz, yz = b * x * y, b * x * z, b * y * z
    xx, yy, zz = b * x * x, b * y * y, b * z * z
    x, y, z = a * x, a * y, a * z
    return np.array(
        [
            [1.0 - yy - zz, xy - z, xz + y],
            [xy + z, 1.0 - xx - zz, yz - x],
            [xz - y, yz + x, 1.0 - xx - yy],
        ]
    )


def log(R: FloatArray) -> FloatArray:
    """Return the rotation vector w (3,) with exp(w) == R and |w| <= pi.

    Computed through the unit quaternion, whose parts stay accurate near 0 and near pi. At exactly
    pi the axis and its opposite are both right; one is returned.
    """
    w, x, y, z = (float(c) for c in to_quaternion(R))
    sine = math.hypot(x, y, z)
    factor = 2.0 * math.atan2(sine, w) / sine if sine else 2.0
    return np.array([factor * x, factor * y, factor * z])


def angle(Ra: FloatArray, Rb: FloatArray) -> float:
    """Return the angle [rad] in [0, pi] between `Ra` and `Rb`, accurate at both ends."""
    R = Ra.T @ Rb
    sine = float(np.linalg.norm(vee(R)))
    return math.atan2(sine, 0.5 * (float(R[0, 0] + R[1, 1] + R[2, 2]) - 1.0))


def rotation_x(theta: float) -> FloatArray:
    """Return the rotation by `theta` [rad] about x."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_y(theta: float) -> FloatArray:
    """Return the rotation by `theta` [rad] about y."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_z(theta: float) -> FloatArray:
    """Return the rotation by `theta` [rad] about z."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def from_rpy(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Return Rz(yaw) Ry(pitch) Rx(roll), angles in rad: URDF's fixed-axis roll, pitch, yaw."""
    return rotation_z(yaw) @ rotation_y(pitch) @ rotation_x(roll)


def to_rpy(R: FloatArray) -> tuple[float, float, float]:
    """Return (roll, pitch, yaw) [rad] of `R`, with pitch in [-pi/2, pi/2].

    When x points straight up or down, only a combination of roll and yaw is defined: yaw is then 0.
    """
    cos_pitch = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], cos_pitch)
    yaw = math.atan2(R[1, 0], R[0, 0]) if cos_pitch > tolerances.GIMBAL_LOCK else 0.0
    c, s = math.cos(yaw), math.sin(yaw)
    roll = math.atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll, pitch, yaw


def from_quaternion(wxyz: npt.ArrayLike) -> FloatArray:
    """Return the rotation of the quaternion (w, x, y, z) (4,), of any length but zero.

    Raises InputError when the quaternion is zero or not finite.
    """
    q = finite_array(wxyz, (4,), "The quaternion")
    length = math.hypot(*q)
    if length == 0.0:
        raise InputError("The quaternion is zero and so has no direction; give a unit quaternion.")
    w, x, y, z = (float(c) for c in q / length)
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )


def to_quaternion(R: FloatArray) -> FloatArray:
    """Return the unit quaternion (w, x, y, z) (4,) of `R` with w >= 0.

    Divides by the largest of the four parts to keep all digits (Shepperd 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    squares = (1.0 + a + e + i, 1.0 + a - e - i, 1.0 - a + e - i, 1.0 - a - e + i)
    largest = squares.index(max(squares))
    rows = (
        (squares[0], h - f, c - g, d - b),
        (h - f, squares[1], d + b, c + g),
        (c - g, d + b, squares[2], h + f),
        (d - b, c + g, h + f, squares[3]),
    )
    q = np.array(rows[largest])
    q /= math.hypot(*rows[largest])
    return -q if q[0] < 0.0 else q


def quaternion_product(p: npt.ArrayLike, q: npt.ArrayLike) -> FloatArray:
    """Return products (w, x, y, z) (..., 4) of quaternions (..., 4): `q` turns first, then `p`."""
    a, b, c, d = np.moveaxis(np.asarray(p, dtype=float), -1, 0)
    w, x, y, z = np.moveaxis(np.asarray(q, dtype=float), -1, 0)
    return np.stack(
        (
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ),
        axis=-1,
    )


def misfit(R: npt.ArrayLike) -> float:
    """Return the largest entry of |R^T R - I| of `R` (3, 3); inf or NaN where that overflows."""
    M = np.asarray(R, dtype=np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.abs(M.T @ M - np.eye(3)).max())


def validated(R: npt.ArrayLike, name: str = "The rotation") -> FloatArray:
    """Return the rotation nearest to `R` (3, 3), as a copy.

    Raises InputError when `R` is not finite, has another shape, or its `misfit` exceeds
    ROTATION_INPUT.
    """
    M = finite_array(R, (3, 3), name)
    off = misfit(M)
    # An overflow gives infinity or NaN.
    if not off <= tolerances.ROTATION_INPUT:
        raise InputError(
            f"{name} is not a rotation: its columns are off orthonormal by {off:.2g} "
            f"(allowed: {tolerances.ROTATION_INPUT:.0e}); remove scale and shear from it."
        )
    U, _, Vt = np.linalg.svd(M)
    nearest: FloatArray = U @ Vt
    if np.linalg.det(nearest) < 0.0:
        raise InputError(f"{name} is a reflection, not a rotation: flip one of its axes.")
    return nearest
