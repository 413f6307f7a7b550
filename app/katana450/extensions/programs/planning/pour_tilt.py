"""The tilt at which a cup pours a given flow, also over time.

It is the inverse of the flow over the lip of the cup. The surface is level and at rest. See
``maths/water/lip.py`` for the rules.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyfit

from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.film import withdrawn_thickness
from katana450.maths.water.lip import THINNING_TIME, viscous_flow, weir_flow
from katana450.maths.water.units import GRAVITY, ML

HALVINGS = 40
"""Number of halvings of the interval that contains the tilt: to 3e-12 rad."""

RAMP_FRACTION = 0.3
"""[1] Fraction of the volume that flows while the flow rises to the rate, and falls again."""

END_RATE = 0.5 * ML
"""[m^3/s] Maximum flow at both ends, where the tilt rests."""

SAMPLES = 49
"""Number of times at which the tilt is computed."""

RATE_DEGREE = 14
"""Degree of the polynomial that gives roll or tilt over time for a rate."""


class RatedTilt(NamedTuple):
    """The tilt of a cup over time with which it pours at a rate.

    Attributes:
        duration: of the pour [s].
        times: (N,) from 0 to ``duration`` [s].
        tilts: (N,) at these times [rad].
    """

    duration: float
    times: FloatArray
    tilts: FloatArray

    def fitted(self, angles: FloatArray) -> FloatArray:
        """Return the coefficients of the polynomial through ``angles`` (N,) at these times.

        They are those of the powers of s, which grows evenly from -1 to 1.
        """
        return frozen(polyfit(2.0 * self.times / self.duration - 1.0, angles, RATE_DEGREE))


@dataclass(frozen=True)
class RatePlan:
    """A flow that rises from ``low`` to ``rate`` [m^3/s] and falls again, and its volume.

    The ramps are polynomials of third degree without a corner.

    Attributes:
        rate: the flow between the ramps.
        low: the flow at both ends.
        ramp: duration of each ramp [s].
        hold: duration between the ramps [s].
    """

    rate: float
    low: float
    ramp: float
    hold: float

    @staticmethod
    def of(volume: float, rate: float) -> RatePlan:
        """Return the plan that pours ``volume`` [m^3] at ``rate`` [m^3/s]."""
        low = min(END_RATE, 0.5 * rate)
        ramp = RAMP_FRACTION * volume / (rate + low)
        return RatePlan(rate, low, ramp, (1.0 - RAMP_FRACTION) * volume / rate)

    @property
    def duration(self) -> float:
        """The duration [s]."""
        return 2.0 * self.ramp + self.hold

    def flow(self, t: float) -> float:
        """Return the flow [m^3/s] at ``t`` [s]."""
        s = min(max(min(t, self.duration - t) / self.ramp, 0.0), 1.0)
        return self.low + (self.rate - self.low) * s * s * (3.0 - 2.0 * s)

    def poured(self, t: float) -> float:
        """Return the volume [m^3] that has flowed until ``t`` [s]."""
        if t > 0.5 * self.duration:
            return 2.0 * self.poured(0.5 * self.duration) - self.poured(self.duration - t)
        s = min(t / self.ramp, 1.0)
        grown = self.ramp * (s**3 - 0.5 * s**4)
        return self.low * t + (self.rate - self.low) * (grown + max(t - self.ramp, 0.0))

    def tilts(self, held: float, cup: Cylinder) -> RatedTilt:
        """Return the tilts of a cup with ``held`` [m^3] at first.

        At each time the tilt is that at which the rest, without the film on the wall, has the flow.
        The times are those of Chebyshev's points and the ends.
        """
        times = 0.5 * self.duration * (1.0 - np.cos(np.linspace(0.0, np.pi, SAMPLES)))
        tilts = []
        for t in times.tolist():
            out = self.poured(t)
            film = film_after(out, held - out, t, cup) if t > 0.0 else 0.0
            tilts.append(tilt_for(self.flow(t), max(held - out - film, 0.0), cup))
        return RatedTilt(self.duration, times, np.array(tilts))


def flow_at(tilt: float, volume: float, cup: Cylinder) -> float:
    """Return the flow [m^3/s] out of a cup with ``volume`` [m^3] at ``tilt`` [rad]."""
    over = volume - cup.holds(tilt)
    head = -cup.margin(tilt, cup.level(tilt, volume))
    if over <= 0.0 or head <= 0.0:
        return 0.0
    weir = weir_flow(cup.radius, tilt, head, GRAVITY)
    thick = viscous_flow(cup.radius, tilt, head, GRAVITY)
    return min(weir, thick) + over / THINNING_TIME


def tilt_for(flow: float, volume: float, cup: Cylinder) -> float:
    """Return the tilt [rad] at which a cup with ``volume`` [m^3] pours ``flow`` [m^3/s].

    The flow grows with the tilt. The result is pi if the flow is not reached.
    """
    low, high = 0.0, math.pi
    for _ in range(HALVINGS):
        tilt = 0.5 * (low + high)
        if flow_at(tilt, volume, cup) < flow:
            low = tilt
        else:
            high = tilt
    return high


def spill_tilt(cup: Cylinder, volume: float) -> float:
    """Return the tilt [rad] from which ``cup`` no longer holds ``volume`` [m^3].

    Down to half of its capacity the floor stays covered and the answer is an arc tangent.
    """
    rise = cup.depth - volume / (math.pi * cup.radius**2)
    if rise <= 0.5 * cup.depth:
        return math.atan2(max(rise, 0.0), cup.radius)
    low, high = math.atan2(0.5 * cup.depth, cup.radius), 0.5 * math.pi
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if cup.holds(middle) > volume:
            low = middle
        else:
            high = middle
    return low


def film_after(poured: float, rest: float, time: float, cup: Cylinder) -> float:
    """Return the volume [m^3] of the film when ``poured`` [m^3] has flowed out in ``time`` [s].

    ``rest`` [m^3] stays in the cup. The surface falls evenly from that of the upright cup to that
    at the tilt that holds the rest.
    """
    full = cup.wetted(0.0, (poured + rest) / (math.pi * cup.radius**2))
    tilt = spill_tilt(cup, rest)
    bared = max(full - cup.wetted(tilt, cup.level(tilt, rest)), 0.0)
    speed = bared / (math.tau * cup.radius * time)
    return 2.0 / 3.0 * bared * withdrawn_thickness(speed, GRAVITY)
