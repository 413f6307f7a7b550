"""The water in the cup, as the arm carries it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.scene_objects import Environment, SceneObject, named
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.geometry.vectors import Vector, scale, sub, vector
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import Water, WaterFlow
from katana450.maths.water.score import Course

CUP, BASIN = "cup", "basin"

ABSENT_BASIN_AT = (100.0, 0.0, 0.0)
"""[m] Where a basin stands that is not there: it catches nothing."""

NO_VELOCITY: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class MotionWithWater:
    """The water, what the cup went through, and where its middle was and how fast, [m], [m/s]."""

    water: Water
    course: Course
    middle: Vector
    velocity: Vector = NO_VELOCITY

    @property
    def still(self) -> bool:
        """Whether nothing of it moves while the cup does not."""
        slosh = self.water.slosh
        return not self.water.parcels and slosh.lean == slosh.rate == (0.0, 0.0)


class Pouring:
    """The rules of it, in one surrounding; its methods are pure."""

    def __init__(self, water_environment: WaterEnvironment, environment: Environment) -> None:
        """``around``: cup, basin and table; where the basin stands the objects say."""
        self._water_environment = water_environment
        self._environment = environment
        # Of the basin as it stands at present: no state, but what follows from it.
        self._made: tuple[SceneObject | None, WaterFlow] | None = None

    def check(self, volume: float) -> None:
        """Raises InputError for more than the cup holds, or less than nothing."""
        self._flow(()).begin(volume, np.eye(4))

    def fill(
        self, volume: float, objects: Sequence[SceneObject], x: FloatArray
    ) -> MotionWithWater | None:
        """``volume`` [m^3] in the cup and none elsewhere; None when there is no cup.

        x: (k,) joints and finger joint [rad]. Raises InputError for more than the cup holds.
        """
        T = self._pose(objects, x)
        if T is None:
            return None
        return MotionWithWater(self._flow(objects).begin(volume, T), Course(), self._middle(T))

    def step(
        self, poured: MotionWithWater, objects: Sequence[SceneObject], x: FloatArray, dt: float
    ) -> MotionWithWater | None:
        """``dt`` [s] on, with the arm at ``x`` (k,) now; the same while nothing of it moves."""
        T = self._pose(objects, x)
        if T is None:
            return None
        stands = bool((poured.water.T_base_cup == T).all())
        if dt <= 0.0 or (stands and poured.still and poured.velocity == NO_VELOCITY):
            return poured
        flow, middle = self._flow(objects), self._middle(T)
        if not stands and not _object(objects, CUP).carried:
            # Somebody put it elsewhere, which is no motion.
            moved = flow.step(poured.water, T, NO_VELOCITY, 0.0)
            return replace(poured, water=moved, middle=middle, velocity=NO_VELOCITY)
        velocity = scale(1.0 / dt, sub(middle, poured.middle))
        acceleration = scale(1.0 / dt, sub(velocity, poured.velocity))
        return MotionWithWater(
            flow.step(poured.water, T, acceleration, dt),
            poured.course.after(acceleration, dt),
            middle,
            velocity,
        )

    def margin_to_rim(self, poured: MotionWithWater, objects: Sequence[SceneObject]) -> float:
        """How far [m] the lip is above the surface; negative while water flows over it."""
        return self._flow(objects).margin_to_rim(poured.water)

    def water_environment(self, objects: Sequence[SceneObject]) -> WaterEnvironment:
        """With the basin where it stands."""
        return self._flow(objects).water_environment

    def _flow(self, objects: Sequence[SceneObject]) -> WaterFlow:
        basin = named(objects, BASIN)
        if self._made is None or self._made[0] is not basin:
            at = ABSENT_BASIN_AT if basin is None else vector(basin.T[:3, 3])
            water_environment = replace(
                self._water_environment, basin=replace(self._water_environment.basin, at=at)
            )
            self._made = (basin, WaterFlow(water_environment))
        return self._made[1]

    def _pose(self, objects: Sequence[SceneObject], x: FloatArray) -> FloatArray | None:
        cup = named(objects, CUP)
        return None if cup is None else self._environment.pose(cup, x)

    def _middle(self, T: FloatArray) -> Vector:
        cup = self._water_environment.cup
        return vector(T[:3, 3] + (cup.floor + 0.5 * cup.inside.depth) * T[:3, 2])


def _object(objects: Sequence[SceneObject], name: str) -> SceneObject:
    return next(each for each in objects if each.name == name)
