"""The initial camera of the exported files of a robot."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.maths.geometry.arrays import FloatArray

FIELD_OF_VIEW = math.radians(40.0)
"""[rad] Vertical field of view of the cameras in exported files."""

VIEW_DIRECTION = (-0.55, 0.75, -0.37)
"""Direction of view, in the root's frame."""


DISTANCE_FACTOR = 0.7
"""Fraction of the distance at which a ball around the robot fills the picture. No robot fills its
ball."""


class InitialCamera(NamedTuple):
    """A camera: eye and target (3,) in the root's frame [m]; z is up."""

    eye: FloatArray
    target: FloatArray


def camera(robot: Robot) -> InitialCamera:
    """Return a camera that sees the whole robot in its common poses."""
    low, high = robot.bounds
    target = (low + high) / 2.0
    radius = max(float(np.linalg.norm(high - low)) / 2.0, 1e-3)
    direction = np.array(VIEW_DIRECTION) / float(np.linalg.norm(VIEW_DIRECTION))
    return InitialCamera(
        target - direction * DISTANCE_FACTOR * radius / math.sin(FIELD_OF_VIEW / 2.0), target
    )
