"""Motion of the water in the cup while the arm carries it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.scene_objects import Environment, SceneObject, named
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.course import Course
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import Water, WaterFlow
from katana450.maths.water.vectors import Vector, scale, sub, vector

CUP, BASIN = "cup", "basin"

ABSENT_BASIN_AT = (100.0, 0.0, 0.0)
"""[m] Place of the basin if the scene has none: so far away that it catches no water."""

NO_VELOCITY: Vector = (0.0, 0.0, 0.0)

FILM_STEP = 1.0
"""[s] Time step of a film that drains in a cup at rest, because each step is published. The film
differs by less than 0.5 % from that of short steps, and the sum of the volumes is exact.
"""


@dataclass(frozen=True, eq=False)
class MotionWithWater:
    """The water, the motion history of the cup, and position [m], velocity [m/s] of its middle.

    ``waited``: time [s] for which the film has still to drain, in a cup at rest.
    """

    water: Water
    course: Course
    middle: Vector
    velocity: Vector = NO_VELOCITY
    waited: float = 0.0

    @property
    def still(self) -> bool:
        """True if the water is at rest as long as the cup does not move, except for its film."""
        slosh = self.water.slosh
        return not self.water.parcels and slosh.lean == slosh.rate == (0.0, 0.0)


class Pouring:
    """Rules of the water in one environment. Its methods are pure."""

    def __init__(self, water_environment: WaterEnvironment, environment: Environment) -> None:
        """Create the rules for the cup, the basin and the table of ``water_environment``.

        The objects of a scene give the place of the basin.
        """
        self._water_environment, self._environment = water_environment, environment
        # Cache for the present place of the basin.
        self._cache: tuple[SceneObject | None, WaterFlow] | None = None

    def check(self, volume: float) -> None:
        """Raise InputError if ``volume`` [m^3] is negative or more than the cup holds."""
        self._flow(()).begin(volume, np.eye(4))

    def fill(
        self, volume: float, objects: Sequence[SceneObject], x: FloatArray
    ) -> MotionWithWater | None:
        """Return ``volume`` [m^3] in the cup and none elsewhere; None without a cup.

        x: (k,) joints and finger joint [rad]. Raises InputError for more than the cup holds.
        """
        T = self._pose(objects, x)
        if T is None:
            return None
        water = self._flow(objects).begin(volume, T)
        return MotionWithWater(water, Course(), self._middle(T))

    def step(
        self, poured: MotionWithWater, objects: Sequence[SceneObject], x: FloatArray, dt: float
    ) -> MotionWithWater | None:
        """Return the water after ``dt`` [s], with the arm now at ``x`` (k,) [rad].

        Returns ``poured`` itself while cup and water are at rest; None if there is no cup. The
        film in a cup at rest drains in steps of FILM_STEP; in between, the water stays the same.
        """
        cup = named(objects, CUP)
        if cup is None:
            return None
        T = self._environment.pose(cup, x)
        at_rest = bool((poured.water.T_base_cup == T).all())
        flow, middle = self._flow(objects), self._middle(T)
        still = at_rest and poured.still and poured.velocity == NO_VELOCITY
        if dt <= 0.0 or (still and flow.film_rests(poured.water)):
            return poured
        water = poured.water
        if still and poured.waited + dt < FILM_STEP and flow.margin_to_rim(water) > 0.0:
            return replace(poured, waited=poured.waited + dt)
        if poured.waited:
            water = flow.step(water, water.T_base_cup, NO_VELOCITY, poured.waited)
        if not at_rest and not cup.carried:
            # The cup was moved by a command, which does not accelerate the water.
            moved = flow.step(water, T, NO_VELOCITY, 0.0)
            return MotionWithWater(moved, poured.course, middle)
        velocity = scale(1.0 / dt, sub(middle, poured.middle))
        # The velocities are those in the middle of this step and of the one before, which is
        # shorter or longer where a STOP or a late tick came between.
        between = 0.5 * (dt + (poured.course.step or dt))
        acceleration = scale(1.0 / between, sub(velocity, poured.velocity))
        water = flow.step(water, T, acceleration, dt)
        return MotionWithWater(water, poured.course.after(acceleration, dt), middle, velocity)

    def margin_to_rim(self, poured: MotionWithWater, objects: Sequence[SceneObject]) -> float:
        """Return the height [m] of the lip over the surface; negative while water flows over it."""
        return self._flow(objects).margin_to_rim(poured.water)

    def water_environment(self, objects: Sequence[SceneObject]) -> WaterEnvironment:
        """Return the environment of the water with the basin where it stands."""
        return self._flow(objects).water_environment

    def _flow(self, objects: Sequence[SceneObject]) -> WaterFlow:
        basin = named(objects, BASIN)
        if self._cache is None or self._cache[0] is not basin:
            at = ABSENT_BASIN_AT if basin is None else vector(basin.T[:3, 3])
            water_environment = replace(
                self._water_environment, basin=replace(self._water_environment.basin, at=at)
            )
            self._cache = (basin, WaterFlow(water_environment))
        return self._cache[1]

    def _pose(self, objects: Sequence[SceneObject], x: FloatArray) -> FloatArray | None:
        cup = named(objects, CUP)
        return None if cup is None else self._environment.pose(cup, x)

    def _middle(self, T: FloatArray) -> Vector:
        cup = self._water_environment.cup
        return vector(T[:3, 3] + (cup.floor + 0.5 * cup.inside.depth) * T[:3, 2])
