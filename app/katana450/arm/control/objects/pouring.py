"""Motion of the water in the cup and in other vessels, one of which the arm carries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.state.scene_objects import SceneObject, Shape, named
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.water.environment import Cup, WaterEnvironment
from katana450.maths.water.flow import (
    Course,
    MotionWithWater,
    VesselMotion,
    VesselMove,
    VesselWater,
    Water,
    WaterFlow,
)
from katana450.maths.water.units import counted
from katana450.maths.water.vectors import Vector, add, scale, sub, vector

CUP, BASIN = "cup", "basin"

MAX_VESSELS = 8
"""Maximum number of vessels with the cup; further ones in the order of objects hold no water."""

ABSENT_BASIN_AT = (100.0, 0.0, 0.0)
"""[m] Place of the basin if the scene has none: so far away that it catches no water."""


def is_vessel(scene_object: SceneObject) -> bool:
    """Return whether an object is the cup or another vessel that holds water in the hand."""
    return scene_object.name == CUP or scene_object.shape is Shape.VESSEL


def vessels_of(objects: Sequence[SceneObject]) -> list[SceneObject]:
    """Return the vessels that hold water, the cup first; none without the cup."""
    cup = named(objects, CUP)
    if cup is None:
        return []
    others = [vessel for vessel in objects if is_vessel(vessel) and vessel is not cup]
    return [cup, *others][:MAX_VESSELS]


class Pouring:
    """Rules of the water in one environment. Its methods are pure."""

    def __init__(self, water_environment: WaterEnvironment, environment: Environment) -> None:
        """Create the rules for the cup, the basin and the table of ``water_environment``.

        The objects of a scene give the place of the basin, and the other vessels.
        """
        self._water_environment, self._environment = water_environment, environment
        # Cache for the present place of the basin and the present vessels.
        self._cache: tuple[list[SceneObject | None], WaterFlow] | None = None

    def check(self, volume: float) -> None:
        """Raise InputError if ``volume`` [m^3] is negative or more than the cup holds."""
        self._flow(()).begin(volume, np.eye(4))

    def fill(
        self, volume: float, objects: Sequence[SceneObject], x: FloatArray
    ) -> MotionWithWater | None:
        """Return ``volume`` [m^3] in the cup and none elsewhere; None without a cup.

        x: (k,) joints and finger joint [rad]. Raises InputError for more than the cup holds.
        """
        self.check(volume)
        return self.settled(Water(()), objects, x, {CUP: counted(volume)})

    def settled(
        self, water: Water, objects: Sequence[SceneObject], x: FloatArray,
        volumes: Mapping[str, int],
    ) -> MotionWithWater | None:  # fmt: skip
        """Return ``water`` at rest in the vessels where they are now; None without a cup.

        ``volumes``: volumes [fl] by the names of vessels; others keep what they have.
        """
        volume_of = {vessel.name: vessel.volume for vessel in water.vessels} | dict(volumes)
        vessels = tuple(
            self._rest(vessel, x, volume_of.get(vessel.name, 0)) for vessel in vessels_of(objects)
        )
        if not vessels:
            return None
        settled = Water(vessels, water.basin, (), water.puddles)
        return self._with_vessels(MotionWithWater(settled, ()), objects, x)

    def step(
        self,
        poured: MotionWithWater,
        objects: Sequence[SceneObject],
        x: FloatArray,
        dt: float,
        last: Sequence[SceneObject] = (),
    ) -> MotionWithWater | None:
        """Return the water after ``dt`` [s], with the arm now at ``x`` (k,) [rad].

        A slip in the hand since the ``last`` objects does not accelerate the water: the state shows
        it in steps.

        Returns ``poured`` itself while vessels and water are at rest; None if there is no cup.
        """
        vessels = vessels_of(objects)
        if not vessels:
            return None
        if [vessel.name for vessel in vessels] != [vessel.name for vessel in poured.water.vessels]:
            poured = self._with_vessels(poured, objects, x)
        water, flow = poured.water, self._flow(objects)
        poses = [self._environment.pose(vessel, x) for vessel in vessels]
        rests = [
            bool((vessel.T == T).all()) for vessel, T in zip(water.vessels, poses, strict=True)
        ]
        if dt <= 0.0 or (all(rests) and poured.still):
            return poured
        motions = list(zip(vessels, poured.motions, poses, strict=True))
        if any(
            not rest and not vessel.carried for rest, vessel in zip(rests, vessels, strict=True)
        ):
            # A vessel was moved by a command, which does not accelerate the water.
            moves = {vessel.name: VesselMove(T) for vessel, _, T in motions}
            placed = tuple(
                VesselMotion(motion.course, self._middle(vessel, T, objects))
                for vessel, motion, T in motions
            )
            return MotionWithWater(flow.step(water, moves, 0.0), placed)
        moves, after = {}, []
        for vessel, motion, T in motions:
            middle, start = self._middle(vessel, T, objects), motion.middle
            old = named(last, vessel.name)
            if vessel.held and old is not None and old.held and old is not vessel:
                unslipped = self._environment.pose(old, x)
                start = add(start, sub(middle, self._middle(vessel, unslipped, objects)))
            velocity = scale(1.0 / dt, sub(middle, start))
            # The velocities are those in the middle of this step and of the one before, which is
            # shorter or longer where a STOP or a late tick came between.
            between = 0.5 * (dt + (motion.course.step or dt))
            acceleration = scale(1.0 / between, sub(velocity, motion.velocity))
            moves[vessel.name] = VesselMove(T, acceleration)
            after.append(VesselMotion(motion.course.after(acceleration, dt), middle, velocity))
        return MotionWithWater(flow.step(water, moves, dt), tuple(after))

    def margin_to_rim(self, poured: MotionWithWater, objects: Sequence[SceneObject]) -> float:
        """Return the height [m] of the lip over the surface; negative while water flows over it.

        It is that of the vessel in the hand, or of the cup.
        """
        held = next((scene_object.name for scene_object in objects if scene_object.held), CUP)
        return self._flow(objects).margin_to_rim(poured.water.vessel(held) or poured.water.cup)

    def water_environment(self, objects: Sequence[SceneObject]) -> WaterEnvironment:
        """Return the environment of the water with the vessels, and the basin where it stands."""
        return self._flow(objects).water_environment

    def _with_vessels(
        self, poured: MotionWithWater, objects: Sequence[SceneObject], x: FloatArray
    ) -> MotionWithWater:
        """Return ``poured`` with the present vessels; the water of one that is gone is gone."""
        known = dict(
            zip(
                [scene_object.name for scene_object in poured.water.vessels],
                poured.motions,
                strict=False,
            )
        )
        waters, motions = [], []
        for scene_object in vessels_of(objects):
            vessel = poured.water.vessel(scene_object.name) or self._rest(scene_object, x, 0)
            waters.append(vessel)
            still = VesselMotion(Course(), self._middle(scene_object, vessel.T, objects))
            motions.append(known.get(scene_object.name) or still)
        water = replace(poured.water, vessels=tuple(waters))
        return replace(poured, water=water, motions=tuple(motions))

    def _rest(self, vessel: SceneObject, x: FloatArray, volume: int) -> VesselWater:
        return VesselWater(vessel.name, volume, frozen(self._environment.pose(vessel, x)))

    def _shape(self, vessel: SceneObject) -> Cup:
        cup = self._water_environment.cup
        return cup.sized(*vessel.extent) if vessel.shape is Shape.VESSEL else cup

    def _flow(self, objects: Sequence[SceneObject]) -> WaterFlow:
        basin, vessels = named(objects, BASIN), vessels_of(objects)
        key = [basin, *vessels]
        if self._cache is None or self._cache[0] != key:
            basin_point = ABSENT_BASIN_AT if basin is None else vector(basin.T[:3, 3])
            shapes = {vessel.name: self._shape(vessel) for vessel in vessels}
            water_environment = replace(
                self._water_environment,
                vessels=shapes or self._water_environment.vessels,
                basin=replace(self._water_environment.basin, at=basin_point),
            )
            self._cache = (key, WaterFlow(water_environment))
        return self._cache[1]

    def _middle(self, vessel: SceneObject, T: FloatArray, objects: Sequence[SceneObject]) -> Vector:
        shape = self.water_environment(objects).vessels[vessel.name]
        return vector(T[:3, 3] + (shape.floor + 0.5 * shape.inside.depth) * T[:3, 2])
