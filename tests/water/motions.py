"""Motions of the cup for tests: its pose and acceleration in each time step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from katana450.extensions.programs.steps.pouring import HALVINGS
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import VesselMove, Water, WaterFlow
from katana450.maths.water.units import GRAVITY

Step = tuple[FloatArray, FloatArray]
"""Pose (4, 4) [m] of the cup, and acceleration (3,) [m/s^2] of its middle, in the base frame."""


def placed(x: float, y: float, z: float, tilt: float = 0.0) -> FloatArray:
    """Return the pose of a cup with the middle of its foot at ``x``, ``y``, ``z`` [m].

    ``tilt`` [rad] turns the cup about x, so that its mouth moves towards -y.
    """
    return se3.from_rotation_translation(so3.exp((tilt, 0.0, 0.0)), (x, y, z))


def over_basin(environment: WaterEnvironment, tilt: float) -> FloatArray:
    """Return the pose of a cup whose mouth is 20 cm over the table, above the middle of the basin.

    ``tilt`` [rad] turns the cup about the middle of its mouth, which stays in place.
    """
    x, y, _ = environment.basin.at
    mouth = environment.cup.floor + environment.cup.inside.depth
    R = so3.exp((tilt, 0.0, 0.0))
    return se3.from_rotation_translation(R, np.array((x, y, 0.2)) - R @ (0.0, 0.0, mouth))


def carried(start: float, distance: float, duration: float, dt: float) -> Iterator[Step]:
    """Yield a cycloidal motion of the cup along x, from rest to rest.

    ``start`` and ``distance`` in m, ``duration`` and time step ``dt`` in s. The maximum
    acceleration is 2 pi distance / duration^2.
    """
    for k in range(1, round(duration / dt) + 1):
        s = math.tau * k * dt / duration
        x = start + distance * (s - math.sin(s)) / math.tau
        a = distance * math.tau / duration**2 * math.sin(s)
        yield placed(x, -0.3, 0.15), np.array((a, 0.0, 0.0))


def poured(
    flow: WaterFlow, water: Water, tilt: Callable[[float], float], duration: float, dt: float
) -> Iterator[Water]:
    """Yield all water after each time step ``dt`` [s], while a cup over the basin is tilted.

    ``tilt`` returns the tilt [rad] at a time [s].
    """
    for k in range(1, round(duration / dt) + 1):
        pose = over_basin(flow.water_environment, tilt(k * dt))
        water = flow.step(water, {"cup": VesselMove(pose)}, dt)
        yield water


def turned_to(final: float, rate: float) -> Callable[[float], float]:
    """Return a tilt over time [s] that rises at ``rate`` [rad/s] to ``final`` [rad] and stays."""
    return lambda t: min(rate * t, final)


def spill_tilt(cup: Cylinder, volume: float) -> float:
    """Return the tilt [rad] from which ``cup`` no longer holds ``volume`` [m^3]."""
    low, high = 0.0, 0.5 * math.pi
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if cup.holds(middle) <= volume else (middle, high)
    return low


def steady_acceleration(cup: Cylinder, volume: float) -> float:
    """Return the maximum steady horizontal acceleration [m/s^2] without a spill.

    The cup is upright with ``volume`` [m^3] of water, and its surface has come to rest. A sudden
    acceleration makes the surface swing to nearly twice the lean.
    """
    return GRAVITY * math.tan(spill_tilt(cup, volume))
