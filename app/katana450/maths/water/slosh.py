"""How the surface in a moving cup tilts: not at once, but swinging about where it would rest.

In a cup that accelerates, water comes to rest square to gravity less the acceleration. On the way
there its surface moves mostly in the first antisymmetric mode of an upright cylinder, an oscillator
of known frequency (Ibrahim, Liquid Sloshing Dynamics, 2005, ch. 1). The surface is taken to stay
flat and to lean by that oscillator alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from katana450.maths.geometry.vectors import Vector
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.units import GRAVITY

FIRST_MODE = 1.8412
"""The first zero of J1', the derivative of the Bessel function."""

DAMPING = 0.02
"""[1] Of critical. Viscosity alone gives a cup of 3 cm radius 0.006 (4.98 nu^1/2 r^-3/4 g^-1/4 over
2 pi: Abramson, NASA SP-106, 1966); the rest is an allowance for its wall that is wetted anew in
every swing."""

SHALLOWEST = 0.25
"""[radius] The depth below which the frequency falls no more: so little water lies in a corner of a
tilted cup and is no longer a layer on its floor."""

REST_TOLERANCE = 1e-4
"""[1] A surface that is off its rest by less than this is at rest: 3 um at the wall of a cup."""


@dataclass(frozen=True)
class Slosh:
    """How the surface leans, in the base frame.

    lean: level part of where its normal points; weight: upright part. Both in units of gravity, so
    that at rest they are what is felt in the cup. rate: of the lean [1/s].
    """

    lean: tuple[float, float] = (0.0, 0.0)
    rate: tuple[float, float] = (0.0, 0.0)
    weight: float = 1.0

    @property
    def up(self) -> Vector:
        """Along the surface's normal."""
        return (*self.lean, self.weight)

    def after(self, acceleration: Vector, omega: float, dt: float) -> Slosh:
        """``dt`` [s] on in a cup under a steady ``acceleration`` [m/s^2]: exact for any ``dt``.

        omega: of the mode [rad/s]. What is felt upright has no part in the mode and counts at once.
        """
        rest = (acceleration[0] / GRAVITY, acceleration[1] / GRAVITY)
        weight = 1.0 + acceleration[2] / GRAVITY
        damped = omega * math.sqrt(1.0 - DAMPING**2)
        decay = math.exp(-DAMPING * omega * dt)
        cosine, sine = decay * math.cos(damped * dt), decay * math.sin(damped * dt)
        lag = DAMPING * omega / damped * sine
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
    """Of the first mode [rad/s] with ``volume`` [m^3] in it: omega^2 = g k tanh(k depth)."""
    depth = max(volume / (math.pi * cup.radius**2), SHALLOWEST * cup.radius)
    k = FIRST_MODE / cup.radius
    return math.sqrt(GRAVITY * k * math.tanh(k * depth))


def steady_acceleration(cup: Cylinder, volume: float) -> float:
    """The greatest horizontal acceleration [m/s^2] that an upright cup of ``volume`` [m^3] stands.

    Kept up, so that the surface has come to rest; one that sets in at once makes it swing to nearly
    twice the lean.
    """
    return GRAVITY * math.tan(cup.spills_at(volume))
