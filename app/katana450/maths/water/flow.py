"""The flow of the water: where it is, and where it is one time step later.

Water that a tilted cup cannot hold leaves over the lip, flies in parcels and lands in the basin, in
the cup again, on the table or on the floor. A film stays on the wall where the surface has fallen,
and drains into the rest. Volumes are whole femtolitres that are only moved, so their sum is
constant.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.film import drained_film, withdrawn_thickness
from katana450.maths.water.lip import DROP_VOLUME, left_over, lip_speed, viscous_flow, weir_flow
from katana450.maths.water.parcel import Ground, Parcel, landing
from katana450.maths.water.puddle import Puddle, spill
from katana450.maths.water.slosh import Slosh, damping, frequency
from katana450.maths.water.units import FEMTOLITRE, GRAVITY, counted
from katana450.maths.water.vectors import Vector, add, norm, scale, sub, vector

MAX_FILM = 0.25
"""Maximum thickness of the film where it is left, relative to the radius of the cup."""

LEVEL_SINE = 1e-9
"""Sine of a tilt below which no side of the rim is the lower one."""

MIN_GRAVITY = 1e-3
"""Apparent weight [g] below which water stays where it is."""


@dataclass(frozen=True, eq=False)
class Water:
    """The state of all water. Volumes in femtolitres.

    Attributes:
        cup, basin: volume in cup and basin, without the film.
        parcels: water in the air, the oldest first.
        puddles: spilled water.
        slosh: lean of the surface in the cup.
        T_base_cup: pose (4, 4) of the cup [m].
        film: volume on the wall of the cup.
        wetted: area [m^2] of wall and floor below the surface in the cup.
    """

    cup: int
    basin: int
    parcels: tuple[Parcel, ...]
    puddles: tuple[Puddle, ...]
    slosh: Slosh
    T_base_cup: FloatArray
    film: int = 0
    wetted: float = 0.0

    @property
    def kept(self) -> int:
        """The volume in the cup with its film."""
        return self.cup + self.film

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
        return self.kept + self.basin + self.air + self.spilled


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
        inside = water_environment.cup.inside
        self._wall = math.pi * inside.radius * (2.0 * inside.depth + inside.radius)

    def begin(self, volume: float, T_base_cup: npt.ArrayLike) -> Water:
        """Return ``volume`` [m^3] at rest in the cup, and none elsewhere.

        Raises InputError when the upright cup does not hold it, or the pose is invalid.
        """
        if not 0.0 <= volume <= self.water_environment.cup.inside.capacity:
            maximum = self.water_environment.cup.inside.capacity * 1e6
            raise InputError(
                f"The cup cannot hold {volume * 1e6:g} ml; give 0 to {maximum:.1f} ml."
            )
        T = frozen(se3.validated(T_base_cup, "The pose of the cup"))
        water = Water(counted(volume), 0, (), (), Slosh(), T)
        return replace(water, wetted=self._wetted(water))

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
        inside = self.water_environment.cup.inside
        omega = frequency(inside, water.cup * FEMTOLITRE)
        slosh = water.slosh.after(pull, omega, damping(inside), dt)
        flown = self._fly(replace(water, slosh=slosh), T, dt)
        return self._drain(self._pour(flown, T, dt), _along_wall(T, pull), dt)

    def film_rests(self, water: Water) -> bool:
        """Return True if no film drains while the cup rests."""
        width, length = self._film_size(water.wetted)
        film = water.film * FEMTOLITRE
        g = _along_wall(water.T_base_cup, (0.0, 0.0, 0.0))
        return drained_film(film, width, length, g, 1.0) == film

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
        if over < DROP_VOLUME or weight < MIN_GRAVITY:
            return replace(water, T_base_cup=T)
        head = max(-cup.margin(tilt, cup.level(tilt, water.cup * FEMTOLITRE)), 0.0)
        g = GRAVITY * weight
        weir = weir_flow(cup.radius, tilt, head, g)
        viscous = viscous_flow(cup.radius, tilt, head, g)
        gone = over - left_over(over, weir, viscous, dt)
        if gone == 0:
            return replace(water, T_base_cup=T)
        point = (
            cup.radius * downhill[0],
            cup.radius * downhill[1],
            self.water_environment.cup.floor + cup.depth,
        )
        lip = _moved(T, point)
        carried = scale(1.0 / dt, sub(lip, _moved(water.T_base_cup, point)))
        speed = lip_speed(head, g)
        velocity = add(carried, scale(speed, _outwards(T, tilt, downhill)))
        return replace(
            water,
            cup=water.cup - gone,
            parcels=(*water.parcels, Parcel(gone, lip, velocity, 0.0, dt)),
            T_base_cup=T,
        )

    def _drain(self, water: Water, g: float, dt: float) -> Water:
        """Leave a film where the surface fell, cover it where it rose, and let it drain.

        ``g`` [m/s^2] is gravity along the wall. The film drains into the water of the cup.
        """
        wetted = self._wetted(water)
        fallen = water.wetted - wetted
        if (water.film == 0 and fallen <= 0.0) or g < MIN_GRAVITY:
            return replace(water, wetted=wetted)
        inside, film = self.water_environment.cup.inside, water.film
        if fallen > 0.0:
            speed = fallen / (math.tau * inside.radius * dt)
            thickness = withdrawn_thickness(speed, g)
            film += min(counted(fallen * min(thickness, MAX_FILM * inside.radius)), water.cup)
        else:
            dry = self._wall - water.wetted
            film -= min(int(film * -fallen / dry), film) if dry > 0.0 else film
        width, length = self._film_size(wetted)
        volume = film * FEMTOLITRE
        left = drained_film(volume, width, length, g, dt)
        film = film if left == volume else min(counted(left), film)
        return replace(water, cup=water.kept - film, film=film, wetted=wetted)

    def _film_size(self, wetted: float) -> tuple[float, float]:
        """Return width and length [m] of the wall outside the ``wetted`` area [m^2]."""
        width = math.tau * self.water_environment.cup.inside.radius
        return width, max(self._wall - wetted, 0.0) / width

    def _wetted(self, water: Water) -> float:
        """Return the area [m^2] of wall and floor below the surface in the cup."""
        surface = self.surface(water)
        return self.water_environment.cup.inside.wetted(surface.tilt, surface.level)

    def _fly(self, water: Water, T: FloatArray, dt: float) -> Water:
        """Move the parcels by ``dt`` [s], and let those land that reach a surface."""
        if not water.parcels:
            return water
        cup, basin, puddles = water.cup, water.basin, water.puddles
        level = self.water_environment.basin.level(basin * FEMTOLITRE)
        before, after = water.T_base_cup.tolist(), T.tolist()
        catches = after[2][2] > 0.0
        over, flying = max(self.water_environment.basin.rim, 0.0), []
        for parcel in water.parcels:
            room = self._cup_holds - cup - water.film
            if catches and parcel.volume <= room and self._caught(parcel, before, after, dt):
                cup += parcel.volume
                continue
            aged = parcel._replace(age=parcel.age + dt)
            if aged.at(aged.age)[2] > over:
                # Above all surfaces: most of the water, so its landing is not computed.
                flying.append(aged)
                continue
            end = landing(aged, self.water_environment, level)
            if end.age > aged.age:
                flying.append(aged)
            elif end.ground is Ground.BASIN:
                caught = int(parcel.volume * end.fraction)
                stays = min(caught, self._basin_holds - basin)
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


def _outwards(T: FloatArray, tilt: float, downhill: Vector) -> Vector:
    """Return the unit vector in the base frame along which water leaves.

    Water leaves a cup in the horizontal direction, and a cup tilted further out of its mouth.
    """
    steep = min(tilt, 0.5 * math.pi)
    local = (math.cos(steep) * downhill[0], math.cos(steep) * downhill[1], math.sin(steep))
    return vector(T[:3, :3] @ local)


def _along_wall(T: FloatArray, pull: Vector) -> float:
    """Return the apparent gravity [m/s^2] along the wall of a cup that accelerates by ``pull``.

    It is the root mean square round the cup: the component along the axis, and that along the
    circumference, which is down on the sides of a lying cup.
    """
    apparent = sub((0.0, 0.0, -GRAVITY), pull)
    along = float(T[0, 2] * apparent[0] + T[1, 2] * apparent[1] + T[2, 2] * apparent[2])
    return math.sqrt(0.5 * (norm(apparent) ** 2 + along**2))


def _moved(T: FloatArray, point: Vector) -> Vector:
    """Return ``point`` transformed by ``T``."""
    return vector(T[:3, :3] @ point + T[:3, 3])


def _seen_from(T: se3.Rows, point: Vector) -> Vector:
    """Return ``point`` in the frame of ``T``; plain floats, because it runs for every parcel."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z), _ = T
    u, v, w = point[0] - x, point[1] - y, point[2] - z
    return a * u + d * v + g * w, b * u + e * v + h * w, c * u + f * v + i * w
