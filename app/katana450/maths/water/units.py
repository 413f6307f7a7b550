"""Constants of water at 20 degrees C under gravity, and the unit in which volumes are counted."""

from __future__ import annotations

GRAVITY = 9.81
"""Gravity [m/s^2]."""

DENSITY, VISCOSITY = 998.2, 1.0016e-3
"""Density [kg/m^3] and dynamic viscosity [Pa s] of water, by the International Association for the
Properties of Water and Steam: releases R6-95 and R12-08.
"""

FEMTOLITRE = 1e-18
"""The unit of volumes [m^3]. Whole units are moved, so that rounding neither creates nor loses
water. A basin holds 2e15 of them, which a float still represents exactly.
"""

ML = 1e-6
"""A millilitre [m^3], the unit that is displayed."""

MILLILITRE = 1_000_000_000_000
"""A millilitre [fl], the unit that is counted."""


def counted(volume: float) -> int:
    """Return the number of whole femtolitres in ``volume`` [m^3]."""
    return int(volume / FEMTOLITRE)
