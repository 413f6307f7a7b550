"""Travel of the tool between two postures, for the measurement of a stop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from katana450.arm.robot.robot import Robot
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward

Travel = Callable[[FloatArray, FloatArray], float]
"""Returns the distance [m] between two postures, each (n + 1,) with the finger joint [rad]."""


def tool_travel(robot: Robot) -> Travel:
    """Return the function for the tool point of ``robot``."""
    chain = robot.require_arm().chain

    def travel(start: FloatArray, end: FloatArray) -> float:
        a, b = (forward(chain, x[:-1])[:3, 3] for x in (start, end))
        return float(np.linalg.norm(b - a))

    return travel
