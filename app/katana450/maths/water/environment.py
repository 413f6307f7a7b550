"""What the water is in, and what it may land on."""

from __future__ import annotations

import math
from dataclasses import dataclass

from katana450.errors import InputError
from katana450.maths.geometry.vectors import Vector
from katana450.maths.water.cylinder import Cylinder


@dataclass(frozen=True)
class Cup:
    """A straight cup: its inside, and how high that begins over the cup's own z = 0 [m]."""

    inside: Cylinder
    floor: float


@dataclass(frozen=True)
class Basin:
    """An upright basin, a cone cut off inside; the fillet round its floor is left out. All in m.

    at: the middle of its foot in the base frame. floor: how high its inside begins over that.
    floor_radius, rim_radius, depth: of its inside. outer_radius: of its widest part.
    """

    at: Vector
    floor: float
    floor_radius: float
    rim_radius: float
    depth: float
    outer_radius: float

    def __post_init__(self) -> None:
        for name in ("floor_radius", "rim_radius", "depth", "outer_radius"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise InputError(f"The basin's {name} is {value}; give metres above 0.")
        if not all(map(math.isfinite, (*self.at, self.floor))):
            raise InputError(f"The basin stands at {self.at}; give three finite numbers in metres.")

    @property
    def capacity(self) -> float:
        """What it holds [m^3]."""
        return self.volume(self.depth)

    @property
    def rim(self) -> float:
        """Where its rim is [m] in the base frame."""
        return self.at[2] + self.floor + self.depth

    def radius(self, level: float) -> float:
        """Of its inside ``level`` over its floor; all [m]."""
        return self.floor_radius + level * (self.rim_radius - self.floor_radius) / self.depth

    def volume(self, level: float) -> float:
        """What it holds [m^3] up to ``level`` [m] over its floor."""
        a, b = self.floor_radius, self.radius(level)
        return math.pi / 3.0 * level * (a * a + a * b + b * b)

    def level(self, volume: float) -> float:
        """How high ``volume`` [m^3] stands over its floor [m]: the inverse, in closed form."""
        slope = (self.rim_radius - self.floor_radius) / self.depth
        part = volume / (math.pi * self.floor_radius**2)
        x = 3.0 * slope * part / self.floor_radius
        # With x small the cube root of 1 + x, less 1, would be rounding alone.
        return self.floor_radius / slope * math.expm1(math.log1p(x) / 3.0) if slope else part


@dataclass(frozen=True)
class TableTop:
    """Its upper face is z = 0 of the base frame; x, y: its ends; floor: the height of that [m]."""

    x: tuple[float, float]
    y: tuple[float, float]
    floor: float


@dataclass(frozen=True)
class WaterEnvironment:
    """All that holds or catches water."""

    cup: Cup
    basin: Basin
    table: TableTop
