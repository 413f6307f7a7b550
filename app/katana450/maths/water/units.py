"""Constants of water at 20 degrees C under gravity, and the unit in which volumes are counted."""

from __future__ import annotations

GRAVITY = 9.81
"""Gravity [m/s^2]."""

DENSITY, VISCOSITY, SURFACE_TENSION = 998.2, 1.0016e-3, 72.74e-3
"""Density [kg/m^3], dynamic viscosity [Pa s] and surface tension against air [N/m] of water, by the
International Association for the Properties of Water and Steam: releases R6-95, R12-08 and R1-76.
"""

FEMTOLITRE = 1e-18
"""The unit of volumes [m^3]. Whole units are moved, so that rounding neither creates nor loses
water. A basin holds 2e15 of them, which a float still represents exactly.
"""

ML = 1e-6
"""A millilitre [m^3], the unit that is displayed."""

REST_FLOW = 1e-9
"""Flow [m^3/s] below which water is taken as at rest: 3.6 ml in an hour."""

MILLILITRE = 1_000_000_000_000
"""A millilitre [fl], the unit that is counted."""


def counted(volume: float) -> int:
    """Return the number of whole femtolitres in ``volume`` [m^3]."""
    return int(volume / FEMTOLITRE)
