"""The flow of the water: where it is, and where it is one time step later.

Water that a tilted cup cannot hold leaves over the lip as over a weir, flies in parcels and lands
in the basin, in the cup again, on the table or on the floor. Volumes are whole femtolitres that are
only moved, so their sum is constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.geometry.vectors import Vector, add, norm, scale, sub, vector
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.parcel import Ground, Parcel, landing
from katana450.maths.water.puddle import Puddle, spill
from katana450.maths.water.slosh import Slosh, frequency
from katana450.maths.water.units import FEMTOLITRE, GRAVITY, MILLILITRE, counted

DISCHARGE = 0.61
"""Discharge coefficient [1] in Poleni's rule for a sharp edge: Kirchhoff's pi / (pi + 2)."""

FILM_TIME = 0.25
"""Time [s] in which the film left over the lip thins to a third. For so thin a film a weir's rule
would give an endless trickle.
"""

DROP_VOLUME = MILLILITRE // 20
"""Volume [fl] over the lip below which it falls at once."""

LEVEL_SINE = 1e-9
"""Sine of a tilt below which no side of the rim is the lower one."""

MIN_GRAVITY = 1e-3
"""Apparent weight [g] below which water stays where it is."""


@dataclass(frozen=True, eq=False)
class Water:
    """The state of all water. Volumes in femtolitres.

    Attributes:
        cup, basin: volume in cup and basin.
        parcels: water in the air, the oldest first.
        puddles: spilled water.
        slosh: lean of the surface in the cup.
        T_base_cup: pose (4, 4) of the cup [m].
    """

    cup: int
    basin: int
    parcels: tuple[Parcel, ...]
    puddles: tuple[Puddle, ...]
    slosh: Slosh
    T_base_cup: FloatArray

    @property
    def air(self) -> int:
        """The volume in the air."""
        return sum(parcel.volume for parcel in self.parcels)

    @property
    def spilled(self) -> int:
        """The volume on table and floor."""
        return sum(puddle.volume for puddle in self.puddles)

    @property
    def total(self) -> int:
        """The volume of all water; a step never changes it."""
        return self.cup + self.basin + self.air + self.spilled


@dataclass(frozen=True)
class WaterSurface:
    """The surface in the cup, as a plane of `Cylinder`.

    Attributes:
        tilt: tilt [rad].
        level: level [m].
        downhill: unit vector to the lowest side of the rim, in the cup's frame and perpendicular to
            its axis.
    """

    tilt: float
    level: float
    downhill: Vector


class WaterFlow:
    """Time steps of the water in one environment. Its methods are pure."""

    def __init__(self, water_environment: WaterEnvironment) -> None:
        self.water_environment = water_environment
        self._cup_holds = counted(water_environment.cup.inside.capacity)
        self._basin_holds = counted(water_environment.basin.capacity)

    def begin(self, volume: float, T_base_cup: npt.ArrayLike) -> Water:
        """Return ``volume`` [m^3] of water at rest in the cup, and none elsewhere.

        Raises InputError when the upright cup does not hold it, or the pose is invalid.
        """
        if not 0.0 <= volume <= self.water_environment.cup.inside.capacity:
            maximum = self.water_environment.cup.inside.capacity * 1e6
            raise InputError(
                f"The cup cannot hold {volume * 1e6:g} ml; give 0 to {maximum:.1f} ml."
            )
        T = frozen(se3.validated(T_base_cup, "The pose of the cup"))
        return Water(counted(volume), 0, (), (), Slosh(), T)

    def step(
        self, water: Water, T_base_cup: npt.ArrayLike, acceleration: npt.ArrayLike, dt: float
    ) -> Water:
        """Return the water after ``dt`` [s], with the cup moved to ``T_base_cup`` (4, 4) meanwhile.

        ``acceleration`` (3,) [m/s^2] is that of the middle of the cup, in the base frame. Raises
        InputError for an invalid pose and for numbers that are not finite.
        """
        T = frozen(se3.validated(T_base_cup, "The pose of the cup"))
        pull = vector(finite_array(acceleration, (3,), "The acceleration of the cup"))
        if not 0.0 <= dt < math.inf:
            raise InputError(f"The time step is {dt} s; give 0 or more seconds.")
        if dt == 0.0:
            return replace(water, T_base_cup=T)
        omega = frequency(self.water_environment.cup.inside, water.cup * FEMTOLITRE)
        slosh = water.slosh.after(pull, omega, dt)
        flown = self._fly(replace(water, slosh=slosh), T, dt)
        return self._pour(flown, T, dt)

    def surface(self, water: Water) -> WaterSurface:
        """Return the surface in the cup."""
        tilt, downhill = _lean(water.slosh, water.T_base_cup)
        level = self.water_environment.cup.inside.level(tilt, water.cup * FEMTOLITRE)
        return WaterSurface(tilt, level, downhill)

    def margin_to_rim(self, water: Water) -> float:
        """Return the height [m] of the lip above the surface; negative while it overflows."""
        surface = self.surface(water)
        return self.water_environment.cup.inside.margin(surface.tilt, surface.level)

    def _pour(self, water: Water, T: FloatArray, dt: float) -> Water:
        """Let the water that the cup cannot hold flow over the lip."""
        cup = self.water_environment.cup.inside
        tilt, downhill = _lean(water.slosh, T)
        weight = norm(water.slosh.up)
        over = water.cup - counted(cup.holds(tilt))
        if over <= 0 or weight < MIN_GRAVITY:
            return replace(water, T_base_cup=T)
        head = max(-cup.margin(tilt, cup.level(tilt, water.cup * FEMTOLITRE)), 0.0)
        g = GRAVITY * weight
        left = _left_over(over, _discharge(cup.radius, tilt, head, g), dt)
        gone = over - left
        point = (
            cup.radius * downhill[0],
            cup.radius * downhill[1],
            self.water_environment.cup.floor + cup.depth,
        )
        lip = _moved(T, point)
        carried = scale(1.0 / dt, sub(lip, _moved(water.T_base_cup, point)))
        speed = 2.0 / 3.0 * DISCHARGE * math.sqrt(2.0 * g * head)
        velocity = add(carried, scale(speed, _outwards(T, tilt, downhill)))
        return replace(
            water,
            cup=water.cup - gone,
            parcels=(*water.parcels, Parcel(gone, lip, velocity, 0.0, dt)),
            T_base_cup=T,
        )

    def _fly(self, water: Water, T: FloatArray, dt: float) -> Water:
        """Move the parcels by ``dt`` [s], and let those land that reach a surface."""
        if not water.parcels:
            return water
        cup, basin, puddles = water.cup, water.basin, water.puddles
        level = self.water_environment.basin.level(basin * FEMTOLITRE)
        before, after = water.T_base_cup.tolist(), T.tolist()
        catches = after[2][2] > 0.0
        flying = []
        for parcel in water.parcels:
            room = self._cup_holds - cup
            if catches and parcel.volume <= room and self._caught(parcel, before, after, dt):
                cup += parcel.volume
                continue
            aged = parcel._replace(age=parcel.age + dt)
            end = landing(aged, self.water_environment, level)
            if end.age > aged.age:
                flying.append(aged)
            elif end.ground is Ground.BASIN:
                stays = min(parcel.volume, self._basin_holds - basin)
                basin += stays
                if stays < parcel.volume:
                    puddles = spill(puddles, self._beside_basin(end.point), parcel.volume - stays)
            else:
                puddles = spill(puddles, end.point, parcel.volume)
        return replace(water, cup=cup, basin=basin, parcels=tuple(flying), puddles=puddles)

    def _caught(self, parcel: Parcel, before: se3.Rows, after: se3.Rows, dt: float) -> bool:
        """Return True if ``parcel`` enters the cup through its mouth in the next ``dt`` [s]."""
        mouth = self.water_environment.cup.floor + self.water_environment.cup.inside.depth
        q = _seen_from(after, parcel.at(parcel.age + dt))
        if q[2] > mouth:
            return False
        p = _seen_from(before, parcel.at(parcel.age))
        if p[2] <= mouth:
            return False
        fraction = (p[2] - mouth) / (p[2] - q[2])
        x, y, _ = add(p, scale(fraction, sub(q, p)))
        return math.hypot(x, y) < self.water_environment.cup.inside.radius

    def _beside_basin(self, point: Vector) -> Vector:
        """Return the place on the table for water that the basin cannot hold."""
        x, y, z = self.water_environment.basin.at
        away = math.hypot(point[0] - x, point[1] - y)
        out = self.water_environment.basin.outer_radius / away if away > 0.0 else 0.0
        return x + out * (point[0] - x), y + out * (point[1] - y), z


def _lean(slosh: Slosh, T: FloatArray) -> tuple[float, Vector]:
    """Return the tilt [rad] of the surface in the cup, and `WaterSurface.downhill`."""
    R = T[:3, :3]
    weight = norm(slosh.up)
    if weight < MIN_GRAVITY:
        return 0.0, (1.0, 0.0, 0.0)
    x, y, z = (np.asarray(slosh.up) @ R / weight).tolist()
    sine = math.hypot(x, y)
    if sine < LEVEL_SINE:
        return (0.0 if z > 0.0 else math.pi), (1.0, 0.0, 0.0)
    return math.atan2(sine, z), (-x / sine, -y / sine, 0.0)


def _discharge(radius: float, tilt: float, head: float, g: float) -> float:
    """Return the flow over the lip [m^3/s] when the surface is ``head`` [m] above it.

    Poleni's rule, (2/3) C sqrt(2 g) head^(3/2) per metre of edge (Chow, Open-Channel Hydraulics,
    1959), summed over the part of the rim below the surface, which is a parabola near its lowest
    point. The result is at most the flow over the whole rim at that head.
    """
    rule = 2.0 / 3.0 * DISCHARGE * math.sqrt(2.0 * g * head) * head
    whole = math.tau * radius
    sine = math.sin(tilt)
    wet = 0.375 * math.pi * math.sqrt(2.0 * radius * head / sine) if sine > 0.0 else whole
    return rule * min(wet, whole)


def _left_over(over: int, discharge: float, dt: float) -> int:
    """Return the part of ``over`` [fl] that is still above the lip after ``dt`` [s].

    The discharge falls with the square of the volume above the lip, and the remaining film falls
    exponentially. Together they follow E' = -k E^2 - E / FILM_TIME, a Bernoulli equation with this
    solution.
    """
    decay = math.exp(-dt / FILM_TIME)
    left = over * decay / (1.0 + discharge / FEMTOLITRE / over * FILM_TIME * (1.0 - decay))
    return int(left) if left > DROP_VOLUME else 0


def _outwards(T: FloatArray, tilt: float, downhill: Vector) -> Vector:
    """Return the unit vector in the base frame along which water leaves.

    Water leaves a cup in the horizontal direction, and a cup tilted further out of its mouth.
    """
    steep = min(tilt, 0.5 * math.pi)
    local = (math.cos(steep) * downhill[0], math.cos(steep) * downhill[1], math.sin(steep))
    return vector(T[:3, :3] @ local)


def _moved(T: FloatArray, point: Vector) -> Vector:
    """Return ``point`` transformed by ``T``."""
    return vector(T[:3, :3] @ point + T[:3, 3])


def _seen_from(T: se3.Rows, point: Vector) -> Vector:
    """Return ``point`` in the frame of ``T``; plain floats, because it runs for every parcel."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = T
    u, v, w = point[0] - x, point[1] - y, point[2] - z
    return a * u + d * v + g * w, b * u + e * v + h * w, c * u + f * v + i * w
