"""The flow of the water: where it is, and where it is one time step later.

Water that a tilted vessel cannot hold leaves over the lip, flies in parcels and lands in the basin,
in a vessel, on the table or on the floor. Volumes are whole femtolitres that are only moved, so
their sum is constant.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.water.cylinder import Cylinder
from katana450.maths.water.environment import Cup, WaterEnvironment
from katana450.maths.water.parcel import Ground, Parcel, Puddle, landing, spill
from katana450.maths.water.slosh import Slosh, damping, frequency
from katana450.maths.water.units import (
    FEMTOLITRE,
    GRAVITY,
    MILLILITRE,
    counted,
)
from katana450.maths.water.vectors import Vector, add, norm, scale, sub, vector

DISCHARGE = 0.61
"""Discharge coefficient [1] in Poleni's rule for a sharp edge: Kirchhoff's pi / (pi + 2)."""

THINNING_TIME = 0.25
"""Time [s] in which water left over the lip thins to a third. An assumption: the rules for a flow
would give an endless trickle.
"""

DROP_VOLUME = MILLILITRE // 20
"""Volume [fl] of a drop: what is over the lip falls once it is as much, and the last drop at once.
"""

WEIR_PARABOLA = 3.0 * math.pi / 8.0
"""Integral of (1 - s^2)^(3/2) over s from -1 to 1: the flow over an edge that rises as a parabola,
over that with its greatest head everywhere on half its wet width.
"""


def weir_flow(radius: float, tilt: float, head: float, g: float) -> float:
    """Return the flow over the lip [m^3/s]; the surface is ``head`` [m] above it.

    Poleni's rule, (2/3) C sqrt(2 g) head^(3/2) per metre of edge (Chow, Open-Channel Hydraulics,
    1959), summed over the part of the rim below the surface, which is a parabola near its lowest
    point. The result is at most the flow over the whole rim at that head.
    """
    whole, sine = math.tau * radius, math.sin(tilt)
    wet = WEIR_PARABOLA * math.sqrt(2.0 * radius * head / sine) if sine > 0.0 else whole
    return lip_speed(head, g) * head * min(wet, whole)


def lip_speed(head: float, g: float) -> float:
    """Return the mean speed [m/s] at the lowest point of the lip, by Poleni's rule."""
    return 2.0 / 3.0 * DISCHARGE * math.sqrt(2.0 * g * head)


def left_over(over: int, weir: float, dt: float) -> int:
    """Return the part of ``over`` [fl] that is still above the lip after ``dt`` [s].

    The flow ``weir`` [m^3/s] falls with the square of the volume above the lip. Besides, what is
    left thins. Both together are an equation of Bernoulli.
    """
    flow, t = weir / (over * FEMTOLITRE) * THINNING_TIME, dt / THINNING_TIME
    left = over * math.exp(-t) / (1.0 - flow * math.expm1(-t))
    return int(left) if left > DROP_VOLUME else 0


AT_THE_MOUTH = 1e-9
"""[m] Height over the mouth up to which water has just left over the lip, and does not fall in."""

LEVEL_SINE = 1e-9
"""Sine of a tilt below which no side of the rim is the lower one."""

REST = Slosh()
"""A level surface at rest."""

MIN_GRAVITY = 1e-3
"""Apparent weight [g] below which water stays where it is."""


@dataclass(frozen=True, eq=False)
class VesselWater:
    """The water in one straight vessel. Volumes in femtolitres.

    Attributes:
        name: name of the vessel.
        volume: volume.
        T: pose (4, 4) of the vessel in the base frame [m].
        slosh: lean of the surface.
    """

    name: str
    volume: int
    T: FloatArray
    slosh: Slosh = REST


@dataclass(frozen=True, eq=False)
class Water:
    """The state of all water. Volumes in femtolitres.

    Attributes:
        vessels: the water in each straight vessel, that in the cup first.
        basin: volume in the basin.
        parcels: water in the air, the oldest first.
        puddles: spilled water.
    """

    vessels: tuple[VesselWater, ...]
    basin: int = 0
    parcels: tuple[Parcel, ...] = ()
    puddles: tuple[Puddle, ...] = ()

    @property
    def cup(self) -> VesselWater:
        """The water in the cup."""
        return self.vessels[0]

    @property
    def others(self) -> tuple[VesselWater, ...]:
        """The water in the vessels that are not the cup."""
        return self.vessels[1:]

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
        return sum(vessel.volume for vessel in self.vessels) + self.basin + self.air + self.spilled

    def vessel(self, name: str) -> VesselWater | None:
        """Return the water in the vessel ``name``; None without such a vessel."""
        return next((vessel for vessel in self.vessels if vessel.name == name), None)


class VesselMove(NamedTuple):
    """The motion of a vessel in a time step.

    Attributes:
        T: pose (4, 4) in the base frame at the end [m].
        acceleration: (3,) of the middle of the vessel in the base frame [m/s^2].
    """

    T: FloatArray
    acceleration: Iterable[float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class WaterSurface:
    """The surface in a vessel, as a plane of `Cylinder`.

    Attributes:
        tilt: tilt [rad].
        level: level [m].
        downhill: unit vector to the lowest side of the rim, in the vessel's frame and
            perpendicular to its axis.
    """

    tilt: float
    level: float
    downhill: Vector


class WaterFlow:
    """Time steps of the water in one environment. Its methods are pure."""

    def __init__(self, water_environment: WaterEnvironment) -> None:
        self.water_environment = water_environment
        self._basin_holds = counted(water_environment.basin.capacity)

    def begin(self, volume: float, T_base_cup: FloatArray) -> Water:
        """Return ``volume`` [m^3] at rest in the cup, and none elsewhere.

        Raises InputError when the upright cup does not hold it.
        """
        if not 0.0 <= volume <= self.water_environment.cup.inside.capacity:
            maximum = self.water_environment.cup.inside.capacity * 1e6
            raise InputError(
                f"The cup cannot hold {volume * 1e6:g} ml; give 0 to {maximum:.1f} ml."
            )
        return Water((VesselWater("cup", counted(volume), frozen(T_base_cup)),))

    def step(self, water: Water, moves: Mapping[str, VesselMove], dt: float) -> Water:
        """Return the water after ``dt`` [s], with the vessels moved meanwhile.

        ``moves``: the motions by the names of the vessels; others rest.
        """
        motions = [moves.get(vessel.name) or VesselMove(vessel.T) for vessel in water.vessels]
        poses = [frozen(motion.T) for motion in motions]
        pulls = [vector(motion.acceleration) for motion in motions]
        if dt == 0.0:
            moved = [replace(vessel, T=T) for vessel, T in zip(water.vessels, poses, strict=True)]
            return replace(water, vessels=tuple(moved))
        swung = [
            self._swing(vessel, pull, dt) for vessel, pull in zip(water.vessels, pulls, strict=True)
        ]
        water = self._fly(replace(water, vessels=tuple(swung)), poses, dt)
        vessels, parcels = [], list(water.parcels)
        for vessel, T in zip(water.vessels, poses, strict=True):
            left, parcel = self._pour(vessel, T, dt)
            vessels.append(left)
            if parcel is not None:
                parcels.append(parcel)
        return replace(water, vessels=tuple(vessels), parcels=tuple(parcels))

    def surface(self, water: VesselWater) -> WaterSurface:
        """Return the surface in a vessel."""
        tilt, downhill = _lean(water.slosh, water.T)
        level = self._inside(water).level(tilt, water.volume * FEMTOLITRE)
        return WaterSurface(tilt, level, downhill)

    def margin_to_rim(self, water: VesselWater) -> float:
        """Return the height [m] of the lip above the surface; negative while it overflows."""
        surface = self.surface(water)
        return self._inside(water).margin(surface.tilt, surface.level)

    def _inside(self, water: VesselWater) -> Cylinder:
        return self.water_environment.vessels[water.name].inside

    def _swing(self, water: VesselWater, pull: Vector, dt: float) -> VesselWater:
        """Let the surface swing in a vessel with the acceleration ``pull`` [m/s^2]."""
        inside = self._inside(water)
        omega = frequency(inside, water.volume * FEMTOLITRE)
        return replace(water, slosh=water.slosh.after(pull, omega, damping(inside), dt))

    def _pour(
        self, water: VesselWater, T: FloatArray, dt: float
    ) -> tuple[VesselWater, Parcel | None]:
        """Move a vessel to ``T``, and let the water that it cannot hold flow over the lip."""
        inside = self._inside(water)
        tilt, downhill = _lean(water.slosh, T)
        weight = norm(water.slosh.up)
        over = water.volume - counted(inside.holds(tilt))
        if over < DROP_VOLUME or weight < MIN_GRAVITY:
            return replace(water, T=T), None
        head = max(-inside.margin(tilt, inside.level(tilt, water.volume * FEMTOLITRE)), 0.0)
        g = GRAVITY * weight
        poured = over - left_over(over, weir_flow(inside.radius, tilt, head, g), dt)
        if poured == 0:
            return replace(water, T=T), None
        mouth = self.water_environment.vessels[water.name].mouth
        point = (inside.radius * downhill[0], inside.radius * downhill[1], mouth)
        lip = _moved(T, point)
        carried = scale(1.0 / dt, sub(lip, _moved(water.T, point)))
        velocity = add(carried, scale(lip_speed(head, g), _outwards(T, tilt, downhill)))
        left = replace(water, volume=water.volume - poured, T=T)
        return left, Parcel(poured, lip, velocity, 0.0, dt)

    def _fly(self, water: Water, poses: Sequence[FloatArray], dt: float) -> Water:
        """Move the parcels by ``dt`` [s], and let those land that reach a surface.

        ``poses``: those of the vessels at the end.
        """
        if not water.parcels:
            return water
        vessels, basin, puddles = list(water.vessels), water.basin, water.puddles
        mouths = [
            (self.water_environment.vessels[receiver.name], receiver.T.tolist(), T.tolist())
            for receiver, T in zip(vessels, poses, strict=True)
        ]
        level = self.water_environment.basin.level(basin * FEMTOLITRE)
        over, flying = max(self.water_environment.basin.rim, 0.0), []
        for parcel in water.parcels:
            caught_by = next(
                (
                    number
                    for number, mouth in enumerate(mouths)
                    if parcel.volume + vessels[number].volume <= counted(mouth[0].inside.capacity)
                    and _caught(*mouth, parcel, dt)
                ),
                None,
            )
            if caught_by is not None:
                vessel = vessels[caught_by]
                vessels[caught_by] = replace(vessel, volume=vessel.volume + parcel.volume)
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
                stays = min(parcel.volume, self._basin_holds - basin)
                basin += stays
                if stays < parcel.volume:
                    puddles = spill(puddles, self._beside_basin(end.point), parcel.volume - stays)
            else:
                puddles = spill(puddles, end.point, parcel.volume)
        return Water(tuple(vessels), basin, tuple(flying), puddles)

    def _beside_basin(self, point: Vector) -> Vector:
        """Return the place on the table for water that the basin cannot hold."""
        x, y, z = self.water_environment.basin.at
        away = math.hypot(point[0] - x, point[1] - y)
        out = self.water_environment.basin.outer_radius / away if away > 0.0 else 0.0
        return x + out * (point[0] - x), y + out * (point[1] - y), z


def _caught(vessel: Cup, before: se3.Rows, after: se3.Rows, parcel: Parcel, dt: float) -> bool:
    """Return True if the middle of ``parcel`` enters the mouth in the next ``dt`` [s]."""
    q = _seen_from(after, parcel.at(parcel.age + dt))
    if q[2] > vessel.mouth or after[2][2] <= 0.0:
        return False
    p = _seen_from(before, parcel.at(parcel.age))
    if p[2] <= vessel.mouth + AT_THE_MOUTH:
        return False
    fraction = (p[2] - vessel.mouth) / (p[2] - q[2])
    x, y, _ = add(p, scale(fraction, sub(q, p)))
    return math.hypot(x, y) < vessel.inside.radius


def _lean(slosh: Slosh, T: FloatArray) -> tuple[float, Vector]:
    """Return the tilt [rad] of the surface in a vessel, and `WaterSurface.downhill`."""
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

    Water leaves a vessel in the horizontal direction, and one tilted further out of its mouth.
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


@dataclass(frozen=True)
class Course:
    """The motion of the cup so far.

    Attributes:
        duration: duration [s].
        peak_jerk: maximum jerk [m/s^3].
        acceleration: the last acceleration [m/s^2]; None before the first.
        at: time of that acceleration since the beginning [s].
        step: duration of the last step [s]; 0 before the first.
    """

    duration: float = 0.0
    peak_jerk: float = 0.0
    acceleration: Vector | None = None
    at: float = 0.0
    step: float = 0.0

    def after(self, acceleration: Vector, dt: float) -> Course:
        """Return the course ``dt`` [s] later, with the cup's ``acceleration`` [m/s^2].

        The acceleration is the difference of the mean velocities of this step and of the one
        before, over the time between their middles. With a constant jerk it is exact where
        ``at`` places it: a third of the difference of both steps after the border between them.
        """
        if dt <= 0.0:
            return self
        jerk, place = 0.0, self.duration + (dt - (self.step or dt)) / 3.0
        if self.acceleration is not None:
            jerk = norm(scale(1.0 / (place - self.at), sub(acceleration, self.acceleration)))
        return Course(self.duration + dt, max(self.peak_jerk, jerk), acceleration, place, dt)


NO_VELOCITY: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class VesselMotion:
    """The motion of a vessel so far, and position [m] and velocity [m/s] of its middle."""

    course: Course
    middle: Vector
    velocity: Vector = NO_VELOCITY


@dataclass(frozen=True, eq=False)
class MotionWithWater:
    """The water and the motion of each vessel."""

    water: Water
    motions: tuple[VesselMotion, ...]

    @property
    def course(self) -> Course:
        """The motion history of the cup."""
        return self.motions[0].course

    @property
    def still(self) -> bool:
        """True if the water is at rest as long as no vessel moves."""
        if self.water.parcels or any(vessel.velocity != NO_VELOCITY for vessel in self.motions):
            return False
        return all(
            vessel.slosh.lean == vessel.slosh.rate == (0.0, 0.0) for vessel in self.water.vessels
        )
