"""Liquids that the cup can hold, with their properties at 20 degrees C."""

from __future__ import annotations

from typing import NamedTuple


class Liquid(NamedTuple):
    """A Newtonian liquid.

    Attributes:
        name: name in scripts and requests.
        density: [kg/m^3].
        viscosity: dynamic viscosity [Pa s].
        surface_tension: against air [N/m].
        colour: red, green and blue (0 to 255, sRGB) in which it is drawn.
    """

    name: str
    density: float
    viscosity: float
    surface_tension: float
    colour: tuple[int, int, int]


WATER = Liquid("water", 998.2, 1.0016e-3, 72.74e-3, (74, 148, 192))
"""Water, by the International Association for the Properties of Water and Steam: releases R6-95
(density), R12-08 (viscosity) and R1-76 (surface tension).
"""

OIL = Liquid("oil", 913.0, 84.0e-3, 32.0e-3, (216, 190, 32))
"""Olive oil: the middle of the range of densities in Codex Standard 33, the viscosity of the CRC
Handbook of Chemistry and Physics (56th ed., 1975), and a typical surface tension of vegetable oils,
which range from 31e-3 to 35e-3 N/m.
"""

HONEY = Liquid("honey", 1421.0, 19.0, 55.0e-3, (194, 116, 0))
"""Clover honey with 16 % of water, 190 poise at 20 degrees C in tables for beekeepers, and the
density between 1417 (18 %) and 1423 (15 %) of these. Surface tension: the middle of 50e-3 to 60e-3
N/m (Bogdanov, Book of Honey, ch. 4). The viscosity halves with 6.5 degrees or 2 % of water more.
"""

LIQUIDS = {each.name: each for each in (WATER, OIL, HONEY)}
"""The liquids by name."""
