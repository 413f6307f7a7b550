"""Screw axes S = (omega, v) (6,) of joints that turn or slide.

Of revolute joints |omega| = 1 and omega . v = 0 (no pitch), of prismatic ones omega = 0, |v| = 1.

Sources: Lynch & Park, Modern Robotics (2017), ch. 3.3.2 and 4.1; Murray, Li & Sastry (1994),
ch. 2.3.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, finite_array


def revolute(direction: npt.ArrayLike, point: npt.ArrayLike) -> FloatArray:
    """Return the screw axis of a turning joint along `direction` through `point`.

    `direction` (3,) has any length; `point` (3,) is in m. The linear part is v = -omega x r. Raises
    InputError when the direction is zero or a number is not finite.
    """
    omega = finite_array(direction, (3,), "The direction of the axis")
    r = finite_array(point, (3,), "The point on the axis")
    length = math.hypot(*omega)
    if length == 0.0:
        raise InputError("The direction of the axis is zero; give the axis a direction.")
    omega /= length
    return np.concatenate((omega, np.cross(r, omega)))


def prismatic(direction: npt.ArrayLike) -> FloatArray:
    """Return the screw axis of a sliding joint along `direction` (3,), of any length.

    Raises InputError when the direction is zero or a number is not finite.
    """
    return np.roll(revolute(direction, np.zeros(3)), 3)


def point_on(S: FloatArray) -> FloatArray:
    """Return the point (3,) [m] of the axis nearest to the origin: omega x v."""
    return np.cross(S[:3], S[3:])


def pitch(S: FloatArray) -> float:
    """Return the travel along the axis per radian [m]; 0 for a pure rotation."""
    return float(S[:3] @ S[3:])


def moved(T: FloatArray, S: FloatArray) -> FloatArray:
    """Return the axis `S` (6,) or axes (6, n), given in {b}, in {a}, by the pose T_a_b."""
    return se3.adjoint(T) @ S
