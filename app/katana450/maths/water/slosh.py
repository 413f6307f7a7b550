"""Sloshing: the surface in a moving cup swings about its rest position.

In an accelerated cup, water comes to rest perpendicular to gravity minus the acceleration. Until
then its surface moves mostly in the first antisymmetric mode of an upright cylinder, an oscillator
of known frequency (Ibrahim, Liquid Sloshing Dynamics, 2005, ch. 1). The surface is assumed to stay
flat and to lean by that oscillator alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.units import DENSITY, GRAVITY, VISCOSITY
from katana450.maths.water.vectors import Vector

FIRST_MODE = 1.8412
"""The first zero of J1', the derivative of the Bessel function."""

WALL_DAMPING = 0.014
"""Damping [1] relative to critical damping: an allowance for the wall, which is wetted again in
every swing.
"""

SHALLOWEST = 0.25
"""Depth [radius] below which the frequency falls no more: so little water lies in a corner of a
tilted cup and is no longer a layer on its floor.
"""

REST_TOLERANCE = 1e-4
"""Deviation [1] from rest below which a surface is at rest: 3 um at the wall of a cup."""


@dataclass(frozen=True)
class Slosh:
    """The lean of the surface, in the base frame.

    Lean and weight are in units of gravity; at rest they are the apparent gravity in the cup.

    Attributes:
        lean: horizontal part of the surface's normal.
        rate: rate of the lean [1/s].
        weight: vertical part of the normal.
    """

    lean: tuple[float, float] = (0.0, 0.0)
    rate: tuple[float, float] = (0.0, 0.0)
    weight: float = 1.0

    @property
    def up(self) -> Vector:
        """The direction of the surface's normal."""
        return (*self.lean, self.weight)

    def after(self, acceleration: Vector, omega: float, zeta: float, dt: float) -> Slosh:
        """Return the slosh after ``dt`` [s] under a steady ``acceleration`` [m/s^2], exactly.

        ``omega`` is the frequency of the mode [rad/s], ``zeta`` its damping [1]. The vertical
        acceleration has no part in the mode and acts at once.
        """
        rest = (acceleration[0] / GRAVITY, acceleration[1] / GRAVITY)
        weight = 1.0 + acceleration[2] / GRAVITY
        damped = omega * math.sqrt(1.0 - zeta**2)
        decay = math.exp(-zeta * omega * dt)
        cosine, sine = decay * math.cos(damped * dt), decay * math.sin(damped * dt)
        lag = zeta * omega / damped * sine
        (x, u), (y, v) = (
            (
                (cosine + lag) * (lean - end) + sine / damped * rate,
                (cosine - lag) * rate - omega**2 / damped * sine * (lean - end),
            )
            for lean, rate, end in zip(self.lean, self.rate, rest, strict=True)
        )
        if math.hypot(x, y, u / omega, v / omega) < REST_TOLERANCE:
            return Slosh(rest, weight=weight)
        return Slosh((rest[0] + x, rest[1] + y), (u, v), weight)


def frequency(cup: Cylinder, volume: float) -> float:
    """Return the frequency [rad/s] of the first mode: omega^2 = g k tanh(k depth).

    ``volume`` [m^3] is the water in the upright cup.
    """
    depth = max(volume / (math.pi * cup.radius**2), SHALLOWEST * cup.radius)
    k = FIRST_MODE / cup.radius
    return math.sqrt(GRAVITY * k * math.tanh(k * depth))


def damping(cup: Cylinder) -> float:
    """Return the damping [1] of the first mode relative to critical damping.

    The viscosity gives 4.98 nu^1/2 r^-3/4 g^-1/4 over 2 pi (Abramson, NASA SP-106, 1966): 0.006 for
    water in a cup of 3 cm radius.
    """
    nu = VISCOSITY / DENSITY
    viscous: float = 4.98 / math.tau * math.sqrt(nu) * cup.radius**-0.75 * GRAVITY**-0.25
    return WALL_DAMPING + viscous
