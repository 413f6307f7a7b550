"""A lower bound on the duration of a path, computed without the app's pacing."""

from __future__ import annotations

import numpy as np

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.path import Path, joint_derivatives, point_derivatives
from katana450.maths.planning.scaling import Bounds


def least_time(path: Path, bounds: Bounds, places: int = 400) -> float:
    """Return the time [s] from rest to rest under limits of speed and acceleration.

    With a limit of jerk it is longer. Method: Bobrow, Dubowsky and Gibson, Time-optimal control of
    robotic manipulators along specified paths (1985). The maximum square of the rate of sigma that
    can still be braked is computed backwards, then reached forwards.
    """
    sigma = np.linspace(0.0, 1.0, places + 1)
    _, q1, q2, _ = joint_derivatives(path, sigma)
    moved = np.linalg.norm(point_derivatives(path, sigma)[1], axis=1)
    v, A = bounds.joints.speed, bounds.joints.acceleration
    with np.errstate(divide="ignore"):
        most = np.minimum((v / np.abs(q1)).min(axis=1), bounds.tool_speed / moved)
    h, square = 1.0 / places, most**2

    def rates(place: int, x: float) -> tuple[float, float]:
        """Return the minimum and maximum second derivative of sigma at the squared rate `x`."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack((-A - q2[place] * x, A - q2[place] * x)) / q1[place]
        low, high = np.fmin(*ends), np.fmax(*ends)
        return float(np.nanmax(low)), float(np.nanmin(high))

    for place in range(places + 1):
        low, high = 0.0, float(square[place])
        least, greatest = rates(place, high)
        for _ in range(40 if least > greatest else 0):
            middle = 0.5 * (low + high)
            least, greatest = rates(place, middle)
            low, high = (middle, high) if least <= greatest else (low, middle)
            square[place] = low
    square[-1] = 0.0
    for place in range(places, 0, -1):
        least = rates(place, float(square[place]))[0]
        square[place - 1] = min(square[place - 1], max(0.0, square[place] - 2.0 * h * least))
    square[0] = 0.0
    for place in range(places):
        most_up = rates(place, float(square[place]))[1]
        square[place + 1] = min(square[place + 1], max(0.0, square[place] + 2.0 * h * most_up))
    rate: FloatArray = np.sqrt(square)
    return float((2.0 * h / (rate[1:] + rate[:-1])).sum())
