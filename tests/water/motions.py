"""Cups on their way: poses, accelerations and steps, as a control loop would give them."""

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
    """A cup with the middle of its foot there, turned about x so that its mouth goes to -y."""
    return se3.from_rotation_translation(so3.exp((tilt, 0.0, 0.0)), (x, y, z))


def over_basin(environment: WaterEnvironment, tilt: float) -> FloatArray:
    """A cup whose mouth is 20 cm over the table, turned about the middle of it."""
    x, y, _ = environment.basin.at
    mouth = environment.cup.floor + environment.cup.inside.depth
    R = so3.exp((tilt, 0.0, 0.0))
    return se3.from_rotation_translation(R, np.array((x, y, 0.2)) - R @ (0.0, 0.0, mouth))


def carried(start: float, way: float, duration: float, dt: float) -> Iterator[Step]:
    """Along x by a cycloid: from rest to rest, with its greatest acceleration 2 pi way / T^2."""
    for k in range(1, round(duration / dt) + 1):
        s = math.tau * k * dt / duration
        x = start + way * (s - math.sin(s)) / math.tau
        a = way * math.tau / duration**2 * math.sin(s)
        yield placed(x, -0.3, 0.15), np.array((a, 0.0, 0.0))


def poured(
    flow: WaterFlow, water: Water, tilt: Callable[[float], float], duration: float, dt: float
) -> Iterator[Water]:
    """The water in a cup over the basin that is tilted by ``tilt`` of the time."""
    for k in range(1, round(duration / dt) + 1):
        water = flow.step(water, over_basin(flow.water_environment, tilt(k * dt)), UPRIGHT, dt)
        yield water


def turned_to(final: float, rate: float) -> Callable[[float], float]:
    """Turning at ``rate`` [rad/s] up to ``final`` [rad], and then standing."""
    return lambda t: min(rate * t, final)
