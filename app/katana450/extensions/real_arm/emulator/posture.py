"""Posture of the emulated arm: joint angles of its description from encoder counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.extensions.real_arm.encoders import EncoderMap
from katana450.extensions.real_arm.plant.gravity import GravityLoads
from katana450.extensions.real_arm.variants import DEFAULT_VARIANT
from katana450.maths.geometry.arrays import FloatArray

ENCODERS = EncoderMap(DEFAULT_VARIANT)


def joints_at(counts: Sequence[float]) -> tuple[FloatArray, float]:
    """Return joint angles (5,) and finger angle [rad] at ``counts`` (6,) of the calibrated arm."""
    joints = ENCODERS.joints(np.array(counts))
    return joints[:-1], float(joints[-1])


def loads_of_robot(robot: Robot) -> Callable[[Sequence[float]], Sequence[float]]:
    """Return the function that finds the weights on the axes at counts; see ``EmulatedArm``."""
    gravity = GravityLoads(robot)
    directions = np.sign(ENCODERS.scale[:-1]).tolist()

    def loads(counts: Sequence[float]) -> Sequence[float]:
        weights = gravity.at(joints_at(counts)[0])
        return (*(a * b for a, b in zip(weights, directions, strict=True)), 0.0)

    return loads
