"""A pose as a value that composes with ``@``, and the forms in which a pose can be given."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.kinematics.chain import Chain

FAR: Final = 30.0
"""[1] Ratio of a distance to the reach from which on its unit is in doubt."""

MILLIMETRES: Final = 1.5e3
"""[1] The same from which on it would be out of reach in millimetres, too."""

LARGEST_ANGLE: Final = 2.1 * math.pi
"""[rad] Angle above which its unit is in doubt."""


def check_metres(chain: Chain, position: Iterable[float], name: str = "The pose") -> None:
    """Raise InputError for a tool point (3,) in {S} that is within reach in millimetres, not in m.

    The message asks for the unit; a target out of reach would be a wrong answer.
    """
    distance = math.hypot(*position)
    if FAR * chain.reach < distance < MILLIMETRES * chain.reach:
        raise InputError(
            f"{name} is {distance:.0f} m away, and the arm reaches {chain.reach:.2g} m. Did you "
            "mean metres? Lengths are in metres here; divide millimetres by 1000."
        )


def check_radians(angles: Iterable[float], name: str) -> None:
    """Raise InputError for an angle [rad] of more than a turn, which degrees would explain."""
    for angle in angles:
        if LARGEST_ANGLE < abs(angle) < math.inf:
            raise InputError(
                f"{name} has the angle {angle:g}, more than a turn. Did you mean radians? "
                f"{angle:g} deg are {math.radians(angle):.4g} rad."
            )


MAX_QUATERNION_MISFIT: Final = 1e-3
"""Maximum deviation of the length of a quaternion from 1: that of one printed with 3 decimals."""


@dataclass(frozen=True, eq=False)
class SE3:
    """A pose T_a_b: ``T_a_b @ T_b_c`` is T_a_c, and ``T_a_b @ points`` are points (..., 3) in {a}.

    Functions that take a pose take it, and ``numpy.asarray`` returns its matrix. A pose printed
    with four decimals gets its nearest rotation.

    Attributes:
        matrix: (4, 4), read-only [m].

    Raises InputError for another shape, NaN, or a matrix that is no pose.

    >>> T = katana450.SE3.from_rpy([0.3, 0.0, 0.1], [0.0, np.pi / 2, 0.0])
    >>> T @ katana450.SE3.from_rpy([0.0, 0.0, 0.05])
    SE3(position=[0.35, 0.0, 0.1], rpy=[0.0, 1.5708, 0.0])
    >>> (T.inverse() @ T.position).tolist()
    [0.0, 0.0, 0.0]
    """

    matrix: FloatArray

    __array_ufunc__ = None
    """None lets ``array @ pose`` be a pose."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "matrix", frozen(se3.validated(self.matrix)))

    @staticmethod
    def from_rpy(position: npt.ArrayLike, rpy: npt.ArrayLike = (0.0, 0.0, 0.0)) -> SE3:
        """Return the pose at ``position`` (3,) [m] with roll, pitch and yaw [rad] as in a URDF.

        The rotation is Rz(yaw) Ry(pitch) Rx(roll). Raises InputError for an angle of more than a
        turn, which seems to be in degrees.
        """
        roll, pitch, yaw = finite_array(rpy, (3,), "The roll, pitch and yaw").tolist()
        check_radians((roll, pitch, yaw), "The orientation")
        return _pose(position, so3.from_rpy(roll, pitch, yaw))

    @staticmethod
    def from_quaternion(position: npt.ArrayLike, wxyz: npt.ArrayLike) -> SE3:
        """Return the pose at ``position`` (3,) [m] with the unit quaternion ``wxyz`` (4,).

        ROS writes x, y, z, w: ``numpy.roll(xyzw, 1)``. Raises InputError if its length is not 1 to
        within three decimals.
        """
        q = finite_array(wxyz, (4,), "The quaternion")
        quaternion_misfit(q)
        return _pose(position, so3.from_quaternion(q))

    @property
    def position(self) -> FloatArray:
        """(3,) the place of the origin of {b} in {a} [m]."""
        return self.matrix[:3, 3]

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) the rotation matrix."""
        return self.matrix[:3, :3]

    @property
    def wxyz(self) -> FloatArray:
        """(4,) the unit quaternion (w, x, y, z) with w >= 0."""
        return so3.to_quaternion(self.rotation)

    @property
    def rpy(self) -> FloatArray:
        """(3,) roll, pitch and yaw [rad], see `from_rpy`."""
        return np.array(so3.to_rpy(self.rotation))

    def inverse(self) -> SE3:
        """Return T_b_a."""
        return SE3(se3.inverse(self.matrix))

    def __matmul__(self, other: Any) -> Any:
        """Return the composed pose for a pose, or the moved points for points (..., 3)."""
        array = np.asarray(pose_matrix(other), dtype=np.float64)
        if array.shape == (4, 4):
            return SE3(self.matrix @ SE3(array).matrix)
        if array.shape[-1:] != (3,):
            raise InputError(f"A pose moves poses (4, 4) or points (..., 3), not {array.shape}.")
        return array @ self.rotation.T + self.position

    def __rmatmul__(self, other: npt.ArrayLike) -> SE3:
        product: SE3 = SE3(np.asarray(other)) @ self
        return product

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        """Return the matrix (4, 4), so that numpy takes a pose for an array."""
        return np.array(self.matrix, dtype=dtype) if copy else np.asarray(self.matrix, dtype=dtype)

    def __repr__(self) -> str:
        """Return position and roll, pitch, yaw as text."""
        numbers = (np.round(part, 4) + 0.0 for part in (self.position, self.rpy))
        position, rpy = (part.tolist() for part in numbers)
        return f"SE3(position={position}, rpy={rpy})"


def _pose(position: npt.ArrayLike, R: FloatArray) -> SE3:
    p = finite_array(position, (3,), "The position")
    return SE3(se3.from_rotation_translation(R, p))


def quaternion_misfit(q: FloatArray, name: str = "The quaternion") -> float:
    """Return how far the length of ``q`` (4,) is from 1. Raises InputError if that is too far."""
    length = math.hypot(*q.tolist())
    misfit = abs(length - 1.0)
    if misfit > MAX_QUATERNION_MISFIT:
        raise InputError(
            f"{name} has the length {length:.4g}, but a rotation has the length 1 "
            f"(allowed: {MAX_QUATERNION_MISFIT:g} off)."
        )
    return misfit


def pose_matrix(pose: Any) -> Any:
    """Return the matrix (4, 4) of a pose: an `SE3`, or a position with an orientation.

    That is a pair of ``position`` (3,) [m] and ``wxyz`` (4,) or roll, pitch, yaw (3,) [rad]. Every
    other value is returned unchanged.
    """
    if isinstance(pose, SE3):
        return pose.matrix
    if isinstance(pose, Sequence) and len(pose) == 2:
        position, orientation = pose
        if np.shape(position) == (3,):
            if np.shape(orientation) == (4,):
                return SE3.from_quaternion(position, orientation).matrix
            if np.shape(orientation) == (3,):
                return SE3.from_rpy(position, orientation).matrix
    return pose
