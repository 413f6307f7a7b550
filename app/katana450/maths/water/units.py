"""Constants of water under gravity, and the unit its volumes are counted in."""

from __future__ import annotations

GRAVITY = 9.81
"""[m/s^2]"""

FEMTOLITRE = 1e-18
"""[m^3] Volumes are moved in whole ones, so that none is made or lost by rounding: a basin holds
2e15 of them, which a float still tells apart."""

ML = 1e-6
"""[m^3] A millilitre, as people tell volumes."""

MILLILITRE = 1_000_000_000_000
"""[fl] The same, as they are counted."""


def counted(volume: float) -> int:
    """The whole femtolitres in ``volume`` [m^3]."""
    return int(volume / FEMTOLITRE)
