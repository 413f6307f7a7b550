"""Conditions on the arm, the objects and the water, by which a script chooses its steps."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar, Self

import numpy as np

from katana450.arm.control.objects.pouring import BASIN, CUP, is_vessel
from katana450.arm.control.state.scene_objects import named
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.language.declaration import Declared, Group, Kind, record
from katana450.extensions.programs.language.kinds import (
    FINGER_PLACE,
    Object,
    ObjectName,
    bound,
    millimetres,
    number,
    one_of,
)
from katana450.extensions.programs.language.places import Point
from katana450.maths.geometry.arrays import frozen
from katana450.maths.water.units import MILLILITRE

MAX_TIME = 86_400.0
"""[s] Maximum time of a condition."""

Millilitres = Annotated[float, number(0.0, 10_000.0, "ml")]
FingerBound = Annotated[float, FINGER_PLACE]
Seconds = Annotated[float, number(0.0, MAX_TIME, "s")]


class Bounded(Declared):
    """A condition on a value, which is within bounds, both included."""

    needs = ("at_least", "at_most")

    at_least: float
    at_most: float

    def has(self, value: float) -> bool:
        """Return whether ``value`` is within the bounds."""
        return self.at_least <= value <= self.at_most


class Condition(Declared):
    """A condition on the measured state of an arm and its surroundings, or on the time.

    Attributes:
        phrase: template of the words for what is measured, with the condition as ``{0}``.
    """

    phrase: ClassVar[str]

    @property
    def words(self) -> str:
        """Words for what is measured, as in "if cup in the hand"."""
        return self.phrase.format(self)

    def checked(self, plan: PlanState) -> Self:  # noqa: ARG002
        """Return the condition for the arm of ``plan``.

        Raises InputError if it can never hold for that arm.
        """
        return self

    @abstractmethod
    def holds(self, state: State, elapsed: float) -> bool:
        """Return whether it holds in ``state``, ``elapsed`` [s] after the program began."""


@dataclass(frozen=True)
class Held(Condition):
    """The fingers hold this object."""

    short = "name"
    phrase = "{0.name} in the hand"

    name: ObjectName

    def checked(self, plan: PlanState) -> Self:
        """Return itself. Raises InputError without such an object."""
        plan.scene_object(self.name)
        return self

    def holds(self, state: State, elapsed: float) -> bool:  # noqa: ARG002
        """Return whether the fingers hold the object."""
        scene_object = named(state.objects, self.name)
        return scene_object is not None and scene_object.held


@dataclass(frozen=True, eq=False)
class Placed(Condition):
    """An object stands at a point.

    Attributes:
        name: name of the object.
        at: (3,) the point [m].
        within: maximum distance from it [m].
        in_base: whether it is in the base frame, not in {S}.
    """

    noun = "placed"
    phrase = "{0.name} at its place"

    name: Object
    at: Point
    within: Annotated[float, millimetres(0.1, 1000.0, "Distance, mm; 10 unless given")] = 0.01
    in_base: bool = False

    def checked(self, plan: PlanState) -> Self:
        """Return the condition in the base frame. Raises InputError without such an object."""
        plan.scene_object(self.name)
        if self.in_base:
            return self
        T = plan.plan_context.T_base_shoulder
        return replace(self, at=frozen(T[:3, :3] @ self.at + T[:3, 3]), in_base=True)

    def holds(self, state: State, elapsed: float) -> bool:  # noqa: ARG002
        """Return whether the object stands there; an object in the hand stands nowhere."""
        scene_object = named(state.objects, self.name)
        if scene_object is None or scene_object.carried:
            return False
        return bool(np.linalg.norm(scene_object.T[:3, 3] - self.at) <= self.within)


@dataclass(frozen=True)
class Volume(Bounded, Condition):
    """Water in the cup, the basin or another vessel, ml."""

    noun = "a volume"
    phrase = "the water in the {0.of}"

    of: ObjectName
    at_least: Millilitres = -math.inf
    at_most: Millilitres = math.inf

    def checked(self, plan: PlanState) -> Self:
        """Return itself. Raises InputError without water, and for another object."""
        if self.of not in (CUP, BASIN) and not is_vessel(plan.scene_object(self.of)):
            raise InputError(f"{self.of} holds no water: only cup, basin and vessels do.")
        if plan.state.poured is None:
            raise InputError(
                "There is no water: there is no cup in the scene, or nothing is filled."
            )
        return self

    def holds(self, state: State, elapsed: float) -> bool:  # noqa: ARG002
        """Return whether the volume is within the bounds."""
        if state.poured is None:
            return False
        water, vessel = state.poured.water, state.poured.water.vessel(self.of)
        if vessel is None and self.of != BASIN:
            return False
        return self.has((water.basin if vessel is None else vessel.volume) / MILLILITRE)


@dataclass(frozen=True)
class FingerPlace(Bounded, Condition):
    """Angle of the fingers, deg, or their place, mm, if they slide.

    Attributes:
        at_least, at_most: bounds [deg or mm]; of a condition that is checked [rad or m].
    """

    noun = "a gripper"
    phrase = "the gripper"

    at_least: FingerBound = -math.inf
    at_most: FingerBound = math.inf

    def checked(self, plan: PlanState) -> Self:
        """Return the condition in rad or m. Raises InputError for an arm without fingers."""
        fingers = plan.plan_context.arm.gripper
        if not fingers.moves:
            raise InputError("This arm has no fingers.")
        scale = 1e-3 if fingers.slides else math.radians(1.0)
        return replace(self, at_least=scale * self.at_least, at_most=scale * self.at_most)

    def holds(self, state: State, elapsed: float) -> bool:  # noqa: ARG002
        """Return whether the fingers are within the bounds."""
        return self.has(state.gripper)


@dataclass(frozen=True)
class ProgramTime(Bounded, Condition):
    """Time since the program began, with pauses, s."""

    noun = "a time"
    phrase = "the time"

    at_least: Seconds = -math.inf
    at_most: Seconds = math.inf

    def holds(self, state: State, elapsed: float) -> bool:  # noqa: ARG002
        """Return whether the time is within the bounds."""
        return self.has(elapsed)


CONDITIONS: dict[str, Kind[Condition]] = {
    "held": record(Held),
    "placed": record(Placed),
    "volume": record(Volume),
    "gripper": record(FingerPlace),
    "time": record(ProgramTime),
}
"""The conditions, by their names in a script."""

CHOICE: Group[Condition | None] = one_of({name: bound(kind) for name, kind in CONDITIONS.items()})
"""One condition of an ``if``, in which names may stand for values."""
