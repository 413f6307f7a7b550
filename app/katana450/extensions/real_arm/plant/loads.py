"""The weights on the axes of a simulated plant."""

from __future__ import annotations

import numpy as np

from katana450.arm.robot.robot import Robot, loads_of
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.statics import holding_torques

COARSE = 0.02
"""[rad] Change of a joint after which the weights are computed again; they change by 2 %."""

NEGLIGIBLE = 0.01
"""[N m] Largest torque of an axis below which it counts as balanced."""


class GravityLoads:
    """The weights on the axes of an arm, from the masses in its description, or else zero."""

    def __init__(self, robot: Robot) -> None:
        """Find the largest torque of each axis, from the stretched posture."""
        self._chain, self._masses = robot.require_arm().chain, loads_of(robot)
        self._weights = (0.0,) * self._chain.n
        self._at: FloatArray | None = None
        self._scale = np.zeros(self._chain.n)
        if self._masses:
            largest = np.abs(holding_torques(self._chain, self._scale, self._masses))
            # An axis that is balanced when stretched holds no weight worth simulating.
            heavy = largest > NEGLIGIBLE
            self._scale[heavy] = 1.0 / largest[heavy]

    def at(self, q: FloatArray) -> tuple[float, ...]:
        """Return the weight (n,) on each axis at the posture ``q`` (n,) [rad], from -1 to 1.

        It is positive if the motor must push towards larger angles to hold the arm.
        """
        if not self._scale.any():
            return self._weights
        if self._at is None or np.abs(q - self._at).max() > COARSE:
            self._at = q.copy()
            torques = holding_torques(self._chain, q, self._masses) * self._scale
            self._weights = tuple(np.clip(torques, -1.0, 1.0).tolist())
        return self._weights
