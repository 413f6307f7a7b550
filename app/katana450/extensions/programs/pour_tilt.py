"""The tilt at which a cup pours a given flow: the inverse of the flow over its lip.

The surface is level and at rest. See ``maths/water/lip.py`` for the rules.
"""

from __future__ import annotations

import math

from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.film import withdrawn_thickness
from katana450.maths.water.lip import THINNING_TIME, viscous_flow, weir_flow
from katana450.maths.water.units import GRAVITY

HALVINGS = 40
"""Number of halvings of the interval that contains the tilt: to 3e-12 rad."""


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
