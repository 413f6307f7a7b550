"""The vessels that hold the water, and the surfaces on which it may land."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.vectors import Vector


@dataclass(frozen=True)
class Cup:
    """A straight cup, which stands on z = 0 of its own frame.

    Attributes:
        inside: its inside.
        floor: height of its inner floor [m].
        outer_radius: radius of its outside [m].
        mass: mass without water [kg]; 0 if it is not known.
    """

    inside: Cylinder
    floor: float
    outer_radius: float
    mass: float = 0.0

    @property
    def mouth(self) -> float:
        """The height [m] of its rim."""
        return self.floor + self.inside.depth

    def sized(self, outer_radius: float, height: float) -> Cup:
        """Return a cup of the same shape with another radius and height [m]."""
        wide, tall = outer_radius / self.outer_radius, height / self.mouth
        inside = Cylinder(wide * self.inside.radius, tall * self.inside.depth)
        return Cup(inside, tall * self.floor, outer_radius, wide**2 * tall * self.mass)


@dataclass(frozen=True)
class Basin:
    """An upright basin with a conical inside; the fillet round its floor is ignored. All in m.

    Attributes:
        at: middle of its foot in the base frame.
        floor: height of its inner floor over the foot.
        floor_radius, rim_radius, depth: dimensions of its inside.
        outer_radius: radius of its widest part.
        mass: mass without water [kg]; 0 if it is not known.
    """

    at: Vector
    floor: float
    floor_radius: float
    rim_radius: float
    depth: float
    outer_radius: float
    mass: float = 0.0

    @property
    def capacity(self) -> float:
        """The volume [m^3] that the basin holds."""
        return self.volume(self.depth)

    @property
    def rim(self) -> float:
        """The height [m] of its rim in the base frame."""
        return self.at[2] + self.floor + self.depth

    def radius(self, level: float) -> float:
        """Return the radius of its inside at ``level`` over its floor; all [m]."""
        return self.floor_radius + level * (self.rim_radius - self.floor_radius) / self.depth

    def volume(self, level: float) -> float:
        """Return the volume [m^3] up to ``level`` [m] over its floor."""
        a, b = self.floor_radius, self.radius(level)
        return math.pi / 3.0 * level * (a * a + a * b + b * b)

    def level(self, volume: float) -> float:
        """Return the level [m] over its floor of ``volume`` [m^3]: the inverse, in closed form."""
        slope = (self.rim_radius - self.floor_radius) / self.depth
        part = volume / (math.pi * self.floor_radius**2)
        x = 3.0 * slope * part / self.floor_radius
        # With small x the direct form (1 + x)^(1/3) - 1 would lose all digits.
        return self.floor_radius / slope * math.expm1(math.log1p(x) / 3.0) if slope else part


@dataclass(frozen=True)
class TableTop:
    """A table top.

    Attributes:
        x, y: its ends [m]; its upper face is z = 0 of the base frame.
        floor: height of the floor [m] in the base frame.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    floor: float


@dataclass(frozen=True)
class WaterEnvironment:
    """The vessels and surfaces that hold or catch water.

    Attributes:
        vessels: the cup and other straight vessels by their names, the cup first.
        basin: the basin.
        table: the table.
    """

    vessels: Mapping[str, Cup]
    basin: Basin
    table: TableTop

    @property
    def cup(self) -> Cup:
        """The cup."""
        return next(iter(self.vessels.values()))
