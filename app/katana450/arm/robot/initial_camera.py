"""Cameras that see a whole robot, whatever its size."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from katana450.arm.robot.robot import Robot
from katana450.maths.geometry.arrays import FloatArray

FIELD_OF_VIEW = math.radians(40.0)
"""[rad] Vertical field of view of the cameras in exported files."""

VIEW_DIRECTION = (-0.55, 0.75, -0.37)
"""Direction of view, in the root's frame."""


DISTANCE_FACTOR = 0.7
"""Fraction of the distance at which a ball around the robot fills the picture. No robot fills its
ball."""


MARGIN = 1.06
"""Ratio of the picture's size to that of the robot in it."""


class InitialCamera(NamedTuple):
    """A camera: eye and target (3,) in the root's frame [m]; z is up."""

    eye: FloatArray
    target: FloatArray


def camera(robot: Robot, direction: ArrayLike = VIEW_DIRECTION) -> InitialCamera:
    """Return a camera along ``direction`` that sees the whole robot in its common poses."""
    low, high = robot.bounds
    target = (low + high) / 2.0
    radius = max(float(np.linalg.norm(high - low)) / 2.0, 1e-3)
    heading = np.asarray(direction, dtype=float) / float(np.linalg.norm(direction))
    return InitialCamera(
        target - heading * DISTANCE_FACTOR * radius / math.sin(FIELD_OF_VIEW / 2.0), target
    )


def fitted(points: FloatArray, direction: FloatArray) -> InitialCamera:
    """Return the nearest camera along ``direction`` (3,) whose square picture has all ``points``.

    ``points``: (n, 3) [m] in the root's frame.
    """
    R = looking(direction)
    projected = points @ R
    tangent = math.tan(FIELD_OF_VIEW / 2.0) / MARGIN
    # A point at depth z (towards the camera) is in the picture if |x - eye_x| is at most
    # (eye_z - z) tan: two bounds for each of x and y, which meet at the nearest camera.
    right = (projected[:, :2] + projected[:, 2:] * tangent).max(axis=0)
    left = (projected[:, :2] - projected[:, 2:] * tangent).min(axis=0)
    middle = (right + left) / 2.0
    depth = float(np.max(right - left)) / 2.0 / tangent + 1e-3
    return InitialCamera(R @ (*middle, depth), R @ (*middle, float(projected[:, 2].mean())))


def looking(direction: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) in the root of a camera along ``direction`` (3,).

    Its x points right, y up and -z ahead. Seen from above, y of the root is up.
    """
    back = -direction / np.linalg.norm(direction)
    right = np.cross((0.0, 0.0, 1.0), back)
    size = float(np.linalg.norm(right))
    right = right / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.column_stack((right, np.cross(back, right), back))
