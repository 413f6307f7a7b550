"""The film of water on the wall of a vessel that is emptied.

A falling surface leaves a film, which drains under gravity. Films are thin and slow, so viscosity
alone resists them. The film counts as one volume: its profile over the wall is that of a film that
has drained for long.
"""

from __future__ import annotations

import math

from katana450.maths.water.units import DENSITY, REST_FLOW, SURFACE_TENSION, VISCOSITY

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
