"""The water in the cup, as the arm carries it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.things import Environment, Thing, named
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.geometry.vectors import Vector, scale, sub, vector
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import Flow, Water
from katana450.maths.water.score import Course

CUP, BASIN = "cup", "basin"

FAR = (100.0, 0.0, 0.0)
"""[m] Where a basin stands that is not there: it catches nothing."""

NOWHERE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Poured:
    """The water, what the cup went through, and where its middle was and how fast, [m], [m/s]."""

    water: Water
    course: Course
    middle: Vector
    velocity: Vector = NOWHERE

    @property
    def still(self) -> bool:
        """Whether nothing of it moves while the cup does not."""
        slosh = self.water.slosh
        return not self.water.parcels and slosh.lean == slosh.rate == (0.0, 0.0)


class Pouring:
    """The rules of it, in one surrounding; its methods are pure."""

    def __init__(self, around: WaterEnvironment, surroundings: Environment) -> None:
        """``around``: cup, basin and table; where the basin stands the things say."""
        self._around = around
        self._surroundings = surroundings
        # Of the basin as it stands at present: no state, but what follows from it.
        self._made: tuple[Thing | None, Flow] | None = None

    def check(self, volume: float) -> None:
        """Raises InputError for more than the cup holds, or less than nothing."""
        self._flow(()).begin(volume, np.eye(4))

    def fill(self, volume: float, things: Sequence[Thing], x: FloatArray) -> Poured | None:
        """``volume`` [m^3] in the cup and none elsewhere; None when there is no cup.

        x: (k,) joints and finger joint [rad]. Raises InputError for more than the cup holds.
        """
        T = self._pose(things, x)
        if T is None:
            return None
        return Poured(self._flow(things).begin(volume, T), Course(), self._middle(T))

    def step(
        self, poured: Poured, things: Sequence[Thing], x: FloatArray, dt: float
    ) -> Poured | None:
        """``dt`` [s] on, with the arm at ``x`` (k,) now; the same while nothing of it moves."""
        T = self._pose(things, x)
        if T is None:
            return None
        stands = bool((poured.water.T_base_cup == T).all())
        if dt <= 0.0 or (stands and poured.still and poured.velocity == NOWHERE):
            return poured
        flow, middle = self._flow(things), self._middle(T)
        if not stands and not _thing(things, CUP).carried:
            # Somebody put it elsewhere, which is no motion.
            moved = flow.step(poured.water, T, NOWHERE, 0.0)
            return replace(poured, water=moved, middle=middle, velocity=NOWHERE)
        velocity = scale(1.0 / dt, sub(middle, poured.middle))
        acceleration = scale(1.0 / dt, sub(velocity, poured.velocity))
        return Poured(
            flow.step(poured.water, T, acceleration, dt),
            poured.course.after(acceleration, dt),
            middle,
            velocity,
        )

    def margin_to_rim(self, poured: Poured, things: Sequence[Thing]) -> float:
        """How far [m] the lip is above the surface; negative while water flows over it."""
        return self._flow(things).margin_to_rim(poured.water)

    def around(self, things: Sequence[Thing]) -> WaterEnvironment:
        """With the basin where it stands."""
        return self._flow(things).around

    def _flow(self, things: Sequence[Thing]) -> Flow:
        basin = named(things, BASIN)
        if self._made is None or self._made[0] is not basin:
            at = FAR if basin is None else vector(basin.T[:3, 3])
            around = replace(self._around, basin=replace(self._around.basin, at=at))
            self._made = (basin, Flow(around))
        return self._made[1]

    def _pose(self, things: Sequence[Thing], x: FloatArray) -> FloatArray | None:
        cup = named(things, CUP)
        return None if cup is None else self._surroundings.pose(cup, x)

    def _middle(self, T: FloatArray) -> Vector:
        cup = self._around.cup
        return vector(T[:3, 3] + (cup.floor + 0.5 * cup.inside.depth) * T[:3, 2])


def _thing(things: Sequence[Thing], name: str) -> Thing:
    return next(each for each in things if each.name == name)
