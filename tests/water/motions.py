"""Motions of cups: poses, accelerations and steps, as a control loop would give them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import Water, WaterFlow

Step = tuple[FloatArray, FloatArray]
"""The pose of the cup (4, 4) and the acceleration of its middle (3,)."""

UPRIGHT = np.zeros(3)


def placed(x: float, y: float, z: float, tilt: float = 0.0) -> FloatArray:
    """Return a cup with the middle of its foot there, turned about x with its mouth to -y."""
    return se3.from_rotation_translation(so3.exp((tilt, 0.0, 0.0)), (x, y, z))


def over_basin(environment: WaterEnvironment, tilt: float) -> FloatArray:
    """Return a cup whose mouth is 20 cm over the table, turned about the middle of its mouth."""
    x, y, _ = environment.basin.at
    mouth = environment.cup.floor + environment.cup.inside.depth
    R = so3.exp((tilt, 0.0, 0.0))
    return se3.from_rotation_translation(R, np.array((x, y, 0.2)) - R @ (0.0, 0.0, mouth))


def carried(start: float, distance: float, duration: float, dt: float) -> Iterator[Step]:
    """Yield a cycloidal motion along x from rest to rest.

    The maximum acceleration is 2 pi distance / T^2.
    """
    for k in range(1, round(duration / dt) + 1):
        s = math.tau * k * dt / duration
        x = start + distance * (s - math.sin(s)) / math.tau
        a = distance * math.tau / duration**2 * math.sin(s)
        yield placed(x, -0.3, 0.15), np.array((a, 0.0, 0.0))


def poured(
    flow: WaterFlow, water: Water, tilt: Callable[[float], float], duration: float, dt: float
) -> Iterator[Water]:
    """Yield the water in a cup over the basin that is tilted by ``tilt`` of the time."""
    for k in range(1, round(duration / dt) + 1):
        water = flow.step(water, over_basin(flow.water_environment, tilt(k * dt)), UPRIGHT, dt)
        yield water


def turned_to(final: float, rate: float) -> Callable[[float], float]:
    """Return a turn at ``rate`` [rad/s] up to ``final`` [rad], then rest."""
    return lambda t: min(rate * t, final)
