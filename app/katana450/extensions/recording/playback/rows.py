"""The recorded states of a few seconds, decoded, and the moment at a time."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from katana450.arm.control.objects.pouring import CUP
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.errors import InputError
from katana450.extensions.recording.files.recording_file import Message, nanoseconds_of
from katana450.extensions.recording.files.simulation import TickReader, content_of
from katana450.extensions.recording.messages import (
    ObjectPose,
    StateRow,
    VesselWaterMessage,
)
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.water.environment import WaterEnvironment
from katana450.maths.water.flow import MotionWithWater, VesselWater, Water
from katana450.maths.water.parcel import Parcel, Puddle, landing
from katana450.maths.water.slosh import Slosh
from katana450.maths.water.units import FEMTOLITRE, MILLILITRE


@dataclass(frozen=True)
class Description:
    """The part of a complete state that other states refer to.

    Attributes:
        t: its time [s].
        objects: the objects by name, with their shapes.
        water: the water; None without a cup.
    """

    t: float
    objects: Mapping[str, SceneObject] = field(default_factory=dict)
    water: Water | None = None


@dataclass(frozen=True)
class RecordedMoment:
    """A recorded state with all its objects.

    Attributes:
        row: the state.
        objects: the objects that can be drawn, each in its pose then.
        water: the water, in which parcels that have landed may still fly; None without a cup.
    """

    row: StateRow
    objects: tuple[SceneObject, ...]
    water: Water | None


class Block:
    """The states from one complete state to the next."""

    def __init__(self, messages: Iterable[Message], descriptions: Iterable[Description]) -> None:
        """Decode ``messages`` of the topic of states.

        ``descriptions`` are those of the complete states before, in and after the block; a later
        one adds objects that an earlier one has not. Raises InputError.
        """
        self._states = list(messages)
        self._times = [state.log_time for state in self._states]
        self._poses: list[Mapping[str, ObjectPose]] = []
        self._described: dict[str, SceneObject] = {}
        self._water: Water | None = None
        poses: dict[str, ObjectPose] = {}
        self._parcels: list[tuple[float, Parcel]] = []
        for message in self._states:
            if LEFT in message.data:
                row = content_of(message, StateRow)
                if row.water is not None and row.water.left is not None:
                    ml, start, velocity, span = row.water.left
                    new = Parcel(round(ml * MILLILITRE), start, velocity, 0.0, span)
                    self._parcels.append((row.t, new))
            # Most states name no object, and are decoded when they are shown.
            if any(change in message.data for change in CHANGES):
                row = content_of(message, StateRow)
                poses = dict(poses)
                row.move_objects(poses)
                if len(poses) > MAX_POSES:
                    raise InputError(f"The recording has more than {MAX_POSES} objects at a time.")
            self._poses.append(poses)
        self._puddles: tuple[Puddle, ...] = ()
        for description in descriptions:
            if description.water is not None:
                # One that has just left is in the state of the same tick too.
                flying = [old for old in description.water.parcels if old.age > 0.0]
                if description.t <= self.start:
                    self._parcels += ((description.t - old.age, old) for old in flying)
            self._described = {**description.objects, **self._described}
            self._water = self._water or description.water
            if description.water is not None:
                self._puddles = self._puddles or description.water.puddles

    @property
    def start(self) -> float:
        """Time of the first state [s]; infinite without one."""
        return self._states[0].t if self._states else math.inf

    def at(self, t: float) -> RecordedMoment | None:
        """Return the last state at or before ``t`` [s]; None if there is none."""
        number = bisect_right(self._times, nanoseconds_of(t)) - 1
        if number < 0:
            return None
        row, poses = content_of(self._states[number], StateRow), self._poses[number]
        objects = tuple(
            # Drawn where it was, so the arm of today does not carry it.
            replace(self._described[name], T=frozen(pose.T), held=False, fixed=False)
            for name, pose in poses.items()
            if name in self._described
        )
        return RecordedMoment(row, objects, self._water_of(row, poses))

    def _water_of(self, row: StateRow, poses: Mapping[str, ObjectPose]) -> Water | None:
        if row.water is None or self._water is None or CUP not in poses:
            return None
        vessels = (VesselWaterMessage(CUP, row.water.cup, row.water.lean), *row.water.vessels)
        return Water(
            tuple(
                _vessel(vessel, poses[vessel.name].T) for vessel in vessels if vessel.name in poses
            ),
            basin=round(row.water.basin * MILLILITRE),
            parcels=tuple(
                drop._replace(age=row.t - t)
                for t, drop in sorted(self._parcels)
                if 0.0 <= row.t - t < MAX_FLIGHT
            ),
            puddles=self._puddles if row.water.spilled > 0.0 else (),
        )


LEFT = b'"left":'
"""Part of the messages of states in which water has left the cup."""

MAX_POSES = 256
"""Maximum number of objects at a time, several times that of a scene."""

MAX_FLIGHT = 1.0
"""[s] Time after which water has landed that fell 5 m."""

CHANGES = (b'"objects":', b'"removed":')
"""Parts of the messages of states in which objects have changed."""


def still_flying(water: Water, environment: WaterEnvironment) -> Water:
    """Return ``water`` without the parcels that have landed."""
    level = environment.basin.level(water.basin * FEMTOLITRE)
    flying = (drop for drop in water.parcels if landing(drop, environment, level).age > drop.age)
    return replace(water, parcels=tuple(flying))


def _vessel(water: VesselWaterMessage, T: FloatArray) -> VesselWater:
    """Return the water in a vessel in its pose ``T`` (4, 4)."""
    slosh = Slosh(water.lean[:2], weight=water.lean[2])
    return VesselWater(water.name, round(water.volume * MILLILITRE), frozen(T), slosh)


def description(reader: TickReader, message: Message) -> Description:
    """Return that of the complete state in ``message``, by the ``reader`` of its file.

    Raises InputError.
    """
    objects: tuple[SceneObject, ...] = reader.field(message, "objects", ())
    poured: MotionWithWater | None = reader.field(message, "poured", None)
    named = {body.name: body for body in objects}
    return Description(message.t, named, None if poured is None else poured.water)
