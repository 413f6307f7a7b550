"""Flow over the lip of a tilted cup."""

from __future__ import annotations

import math

from katana450.maths.water.units import DENSITY, FEMTOLITRE, MILLILITRE, REST_FLOW, VISCOSITY

DISCHARGE = 0.61
"""Discharge coefficient [1] in Poleni's rule for a sharp edge: Kirchhoff's pi / (pi + 2)."""

THINNING_TIME = 0.25
"""Time [s] in which water left over the lip thins to a third. An assumption: the rules for a flow
would give an endless trickle.
"""

DROP_VOLUME = MILLILITRE // 20
"""Volume [fl] of a drop: what is over the lip falls once it is as much, and the last drop at once.
"""

WEIR_PARABOLA, FILM_PARABOLA = 3.0 * math.pi / 8.0, 32.0 / 35.0
"""Integrals of (1 - s^2)^(3/2) and of (1 - s^2)^3 over s from -1 to 1: the flow over an edge that
rises as a parabola, over that with its greatest head everywhere on half its wet width.
"""


def weir_flow(radius: float, tilt: float, head: float, g: float) -> float:
    """Return the flow over the lip [m^3/s] without viscosity; the surface is ``head`` [m] above it.

    Poleni's rule, (2/3) C sqrt(2 g) head^(3/2) per metre of edge (Chow, Open-Channel Hydraulics,
    1959), summed over the part of the rim below the surface, which is a parabola near its lowest
    point. The result is at most the flow over the whole rim at that head.
    """
    rule = 2.0 / 3.0 * DISCHARGE * math.sqrt(2.0 * g * head) * head
    return rule * _wet_width(radius, tilt, head, WEIR_PARABOLA)


def viscous_flow(radius: float, tilt: float, head: float, g: float) -> float:
    """Return the maximum flow over the lip [m^3/s] that its viscosity allows.

    A film as thick as the head runs down the outside of the lip: rho g head^3 / (3 mu) per metre of
    edge (Nusselt, 1916; Bird, Stewart and Lightfoot, Transport Phenomena, 2nd ed., ch. 2.2),
    summed as for ``weir_flow``.
    """
    rule = DENSITY * g * head**3 / (3.0 * VISCOSITY)
    return rule * _wet_width(radius, tilt, head, FILM_PARABOLA)


def lip_speed(head: float, g: float) -> float:
    """Return the mean speed [m/s] at the lowest point of the lip, by the slower of both rules."""
    film = DENSITY * g * head**2 / (3.0 * VISCOSITY)
    return min(2.0 / 3.0 * DISCHARGE * math.sqrt(2.0 * g * head), film)


def left_over(over: int, weir: float, viscous: float, dt: float) -> int:
    """Return the part of ``over`` [fl] that is still above the lip after ``dt`` [s].

    The flow ``weir`` [m^3/s] falls with the square of the volume above the lip, and the ``viscous``
    flow with its power 3.5; the slower one holds. Besides, what is left thins.
    """
    volume = over * FEMTOLITRE
    if viscous + volume / THINNING_TIME < REST_FLOW:
        return over
    left = over * max(
        _remaining(weir / volume * THINNING_TIME, 1.0, dt / THINNING_TIME),
        _remaining(viscous / volume * THINNING_TIME, 2.5, dt / THINNING_TIME),
    )
    return int(left) if left > DROP_VOLUME else 0


def _remaining(flow: float, power: float, t: float) -> float:
    """Return E(t) of E' = -flow E^(1 + power) - E with E(0) = 1, an equation of Bernoulli."""
    return math.exp(-t - math.log1p(-flow * math.expm1(-power * t)) / power)


def _wet_width(radius: float, tilt: float, head: float, parabola: float) -> float:
    """Return the width [m] of the edge that has the same flow with the full head everywhere."""
    whole, sine = math.tau * radius, math.sin(tilt)
    wet = parabola * math.sqrt(2.0 * radius * head / sine) if sine > 0.0 else whole
    return min(wet, whole)
