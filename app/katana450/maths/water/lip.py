"""Flow over the lip of a tilted cup, and the film of water on the wall of one that is emptied.

A falling surface leaves a film, which drains under gravity. Films are thin and slow, so viscosity
alone resists them. The film counts as one volume: its profile over the wall is that of a film that
has drained for long.
"""

from __future__ import annotations

import math

from katana450.maths.water.units import (
    DENSITY,
    FEMTOLITRE,
    MILLILITRE,
    REST_FLOW,
    SURFACE_TENSION,
    VISCOSITY,
)

LANDAU_LEVICH = 0.944
"""Factor [1] of the law of Landau and Levich. Their thickness divided by that of Derjaguin is this
factor times the sixth root of the capillary number.
"""


def withdrawn_thickness(speed: float, g: float) -> float:
    """Return the thickness [m] of the film that a surface leaves as it recedes along a wall.

    A thick film is limited by gravity, (mu U / rho g)^(1/2) (Derjaguin, C. R. Acad. Sci. URSS 39,
    1943), and a thin one by surface tension, 0.944 (sigma / rho g)^(1/2) Ca^(2/3) with
    Ca = mu U / sigma (Landau and Levich, Acta Physicochim. URSS 17, 1942). The smaller one holds.

    ``speed`` U [m/s] along the wall; ``g`` [m/s^2] along the wall, above 0.
    """
    capillary = VISCOSITY * speed / SURFACE_TENSION
    limited: float = min(LANDAU_LEVICH * capillary ** (1.0 / 6.0), 1.0)
    return limited * math.sqrt(VISCOSITY * speed / (DENSITY * g))


def drained_film(volume: float, width: float, length: float, g: float, dt: float) -> float:
    """Return what is left of a film of ``volume`` [m^3] after ``dt`` [s].

    A film that drains for the time t down a wall has the thickness (mu z / (rho g t))^(1/2) at the
    distance z from its upper edge (Jeffreys, The draining of a vertical plate, Proc. Camb. Phil.
    Soc. 26, 1930). Integrated over the wall, its volume is (2/3) width length^(3/2)
    (mu / (rho g t))^(1/2). The volume gives t, the age of the film; so any number of steps gives
    the same as one. A film that loses less than REST_FLOW stays.

    ``width`` and ``length`` [m] of the wall across and along the flow, ``g`` [m/s^2] along it.
    """
    rate = DENSITY * g * volume * volume
    if rate == 0.0 or length == 0.0:
        return 0.0 if length == 0.0 else volume
    age = 4.0 / 9.0 * width**2 * length**3 * VISCOSITY / rate
    return volume if volume < 2.0 * age * REST_FLOW else volume / math.sqrt(1.0 + dt / age)


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
