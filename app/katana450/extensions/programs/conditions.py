"""Conditions on the arm, the objects and the water, as a script waits for them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Protocol, Self, TypeVar

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.pouring import BASIN, CUP, is_vessel
from katana450.arm.control.scene_objects import named
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs import places
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.places import MAX_JOINTS
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.scope import Scope
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.forward import forward
from katana450.maths.water.units import MILLILITRE

MAX_TIME = 86_400.0
"""[s] Maximum time of a condition."""


class ValueBounds(NamedTuple):
    """Bounds of a measured value, both included."""

    at_least: float = -math.inf
    at_most: float = math.inf

    @classmethod
    def read(cls, fields: Fields, number: Callable[[YamlValue], float]) -> ValueBounds:
        """Read ``at_least`` and ``at_most``, of which at least one is needed."""
        found = cls(
            fields.take("at_least", number, -math.inf), fields.take("at_most", number, math.inf)
        )
        if found == cls() and not fields.problems:
            problem = f"{fields.what.capitalize()} needs `at_least`, `at_most` or both."
            fields.problems += fields.value.wrong(problem).problems
        return found

    def hold(self, value: float) -> bool:
        """Return whether ``value`` is within the bounds."""
        return self.at_least <= value <= self.at_most


class Condition(Protocol):
    """A condition on the measured state of an arm and its surroundings."""

    @property
    def awaited(self) -> str:
        """Words for what is awaited, as in "wait for cup in the hand"."""
        ...

    def checked(self, builder: PlanBuilder) -> Condition:
        """Return the condition for the arm of ``builder``.

        Raises InputError if it can never hold for that arm.
        """
        ...

    def holds(self, state: State) -> bool:
        """Return whether it holds in ``state``."""
        ...


@dataclass(frozen=True)
class Held:
    """The fingers hold the object ``name``."""

    name: str

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the name of an object. Raises ScriptError."""
        return cls(read.text(value))

    @property
    def awaited(self) -> str:
        """Words for what is awaited."""
        return f"{self.name} in the hand"

    def checked(self, builder: PlanBuilder) -> Self:
        """Return itself. Raises InputError without such an object."""
        builder.scene_object(self.name)
        return self

    def holds(self, state: State) -> bool:
        """Return whether the fingers hold the object."""
        found = named(state.objects, self.name)
        return found is not None and found.held


@dataclass(frozen=True, eq=False)
class Placed:
    """The object ``name`` stands within ``within`` [m] of the point ``at`` (3,) [m]."""

    name: str
    at: FloatArray
    within: float
    in_base: bool

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read {object, at, within}. Raises ScriptError."""
        fields = Fields(value, "placed")
        found = cls(
            fields.need("object", read.text, ""),
            fields.need("at", lambda each: places.point(each, setting), frozen(np.zeros(3))),
            fields.take("within", read.millimetres(0.1, 1000.0), 0.01),
            setting.in_base,
        )
        fields.done()
        return found

    @property
    def awaited(self) -> str:
        """Words for what is awaited."""
        return f"{self.name} at its place"

    def checked(self, builder: PlanBuilder) -> Self:
        """Return the condition in the base frame. Raises InputError without such an object."""
        builder.scene_object(self.name)
        if self.in_base:
            return self
        T = builder.plan_context.T_base_shoulder
        return replace(self, at=frozen(T[:3, :3] @ self.at + T[:3, 3]), in_base=True)

    def holds(self, state: State) -> bool:
        """Return whether the object stands there; an object in the hand stands nowhere."""
        found = named(state.objects, self.name)
        if found is None or found.carried:
            return False
        return bool(np.linalg.norm(found.T[:3, 3] - self.at) <= self.within)


@dataclass(frozen=True)
class Volume:
    """The water in the basin or in a vessel is within ``bounds`` [ml]."""

    of: str
    bounds: ValueBounds

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read {of, at_least, at_most}. Raises ScriptError."""
        fields = Fields(value, "a volume")
        of = fields.need("of", read.text, CUP)
        found = cls(of, ValueBounds.read(fields, read.number(0.0, 10_000.0, "ml")))
        fields.done()
        return found

    @property
    def awaited(self) -> str:
        """Words for what is awaited."""
        return f"the water in the {self.of}"

    def checked(self, builder: PlanBuilder) -> Self:
        """Return itself. Raises InputError without water, and for another object."""
        if self.of not in (CUP, BASIN) and not is_vessel(builder.scene_object(self.of)):
            raise InputError(f"{self.of} holds no water: only cup, basin and vessels do.")
        if builder.state.poured is None:
            raise InputError(
                "There is no water: there is no cup in the scene, or nothing is filled."
            )
        return self

    def holds(self, state: State) -> bool:
        """Return whether the volume is within the bounds."""
        if state.poured is None:
            return False
        water, vessel = state.poured.water, state.poured.water.vessel(self.of)
        if vessel is None and self.of != BASIN:
            return False
        return self.bounds.hold((water.basin if vessel is None else vessel.volume) / MILLILITRE)


@dataclass(frozen=True)
class JointAngle:
    """The angle of the joint ``axis``, from 0, is within ``bounds`` [rad]."""

    axis: int
    bounds: ValueBounds

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read {axis, at_least, at_most}. Raises ScriptError."""
        fields = Fields(value, "a joint")
        axis = fields.need("axis", read.whole(1, MAX_JOINTS), 1)
        found = cls(axis - 1, ValueBounds.read(fields, read.angle(-720.0, 720.0)))
        fields.done()
        return found

    @property
    def awaited(self) -> str:
        """Words for what is awaited."""
        return f"axis {self.axis + 1}"

    def checked(self, builder: PlanBuilder) -> Self:
        """Return itself. Raises InputError if the arm or the limits of the joint exclude it."""
        chain = builder.plan_context.arm.chain
        if self.axis >= chain.n:
            raise InputError(f"There is no axis {self.axis + 1}: the robot has {chain.n} axes.")
        lower, upper = float(chain.lower[self.axis]), float(chain.upper[self.axis])
        if self.bounds.at_least > upper or self.bounds.at_most < lower:
            raise InputError(
                f"Axis {self.axis + 1} never gets there: its range is {math.degrees(lower):.1f} to "
                f"{math.degrees(upper):.1f} deg."
            )
        return self

    def holds(self, state: State) -> bool:
        """Return whether the angle is within the bounds."""
        return self.bounds.hold(float(state.q[self.axis]))


@dataclass(frozen=True)
class FingerPlace:
    """The place of the fingers is within ``bounds`` [deg or mm in a script, else rad or m]."""

    bounds: ValueBounds

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read {at_least, at_most}. Raises ScriptError."""
        return cls(_bounds(value, "a gripper", read.number(-180.0, 180.0, "deg or mm")))

    @property
    def awaited(self) -> str:
        """Words for what is awaited."""
        return "the gripper"

    def checked(self, builder: PlanBuilder) -> Self:
        """Return the condition in rad or m. Raises InputError for an arm without fingers."""
        fingers = builder.plan_context.arm.gripper
        if not fingers.moves:
            raise InputError("This arm has no fingers.")
        scale = 1e-3 if fingers.slides else math.radians(1.0)
        return replace(self, bounds=ValueBounds(*(scale * each for each in self.bounds)))

    def holds(self, state: State) -> bool:
        """Return whether the fingers are within the bounds."""
        return self.bounds.hold(state.gripper)


@dataclass(frozen=True, eq=False)
class ToolPlace:
    """Coordinates of the tool point are within ``bounds`` [m], in the frame of the script.

    Attributes:
        bounds: the bounds by the names of the coordinates.
        in_base: whether they are in the base frame, not in {S}.
        arm: the arm model, once it is known.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
    """

    bounds: Mapping[str, ValueBounds]
    in_base: bool
    arm: ArmModel | None = None
    T_base_shoulder: FloatArray = field(default_factory=lambda: np.eye(4))

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read bounds of x, y and z. Raises ScriptError."""
        fields = Fields(value, "a tool")
        found = {name: fields.take(name, _length_bounds, None) for name in read.XYZ}
        bounds = {name: each for name, each in found.items() if each is not None}
        if not bounds and not fields.problems:
            problem = "A tool needs bounds of `x`, `y` or `z`."
            fields.problems += value.wrong(problem).problems
        fields.done()
        return cls(bounds, setting.in_base)

    @property
    def awaited(self) -> str:
        """Words for what is awaited."""
        return f"{' and '.join(self.bounds)} of the tool"

    def checked(self, builder: PlanBuilder) -> Self:
        """Return the condition for the arm of ``builder``."""
        context = builder.plan_context
        return replace(self, arm=context.arm, T_base_shoulder=context.T_base_shoulder)

    def holds(self, state: State) -> bool:
        """Return whether the point of the present tool frame is within the bounds."""
        assert self.arm is not None
        p = forward(self.arm.chain_to(state.tool), state.q)[:3, 3]
        if self.in_base:
            p = self.T_base_shoulder[:3, :3] @ p + self.T_base_shoulder[:3, 3]
        at = dict(zip(read.XYZ, p.tolist(), strict=True))
        return all(bounds.hold(at[name]) for name, bounds in self.bounds.items())


def _length_bounds(value: YamlValue) -> ValueBounds:
    return _bounds(value, "a coordinate", read.millimetres())


def _bounds(value: YamlValue, what: str, number: Callable[[YamlValue], float]) -> ValueBounds:
    """Read a mapping with bounds alone; ``what`` names it in messages. Raises ScriptError."""
    fields = Fields(value, what)
    found = ValueBounds.read(fields, number)
    fields.done()
    return found


@dataclass(frozen=True)
class ProgramTime:
    """The time since the program began, with pauses, is within ``bounds`` [s]."""

    bounds: ValueBounds

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read {at_least, at_most}. Raises ScriptError."""
        return cls(_bounds(value, "a time", read.number(0.0, MAX_TIME, "s")))

    @property
    def awaited(self) -> str:
        """Words for what is awaited."""
        return "the time"


C_co = TypeVar("C_co", covariant=True)


class ConditionReader(Protocol[C_co]):
    """Reader of a condition."""

    def __call__(self, value: YamlValue, setting: ScriptContext) -> C_co:
        """Return the condition ``value``. Raises ScriptError."""
        ...


CONDITIONS: Mapping[str, ConditionReader[Condition]] = {
    "held": Held.read,
    "placed": Placed.read,
    "volume": Volume.read,
    "joint": JointAngle.read,
    "gripper": FingerPlace.read,
    "tool": ToolPlace.read,
}
"""Readers of the conditions on the state, by their names in a script."""

CHOICE_CONDITIONS: Mapping[str, ConditionReader[Condition | ProgramTime]] = {
    **CONDITIONS,
    "time": ProgramTime.read,
}
"""Readers of all conditions of an ``if``, by their names in a script."""


def one_condition(
    fields: Fields,
    readers: Mapping[str, ConditionReader[C_co]],
    setting: ScriptContext,
    scope: Scope | None = None,
) -> C_co | None:
    """Return the only condition of ``readers`` that ``fields`` has; None after a mistake.

    Names of ``scope`` may stand for values. Mistakes are added to the problems of ``fields``.
    """

    def condition(name: str) -> C_co | None:
        def bound(value: YamlValue) -> C_co:
            return readers[name](value if scope is None else scope.bound(value), setting)

        return fields.take(name, bound, None)

    found = [condition(name) for name in readers if fields.has(name)]
    if len(found) == 1:
        return found[0]
    problem = f"{fields.what.capitalize()} needs exactly one of {', '.join(readers)}."
    fields.problems += fields.value.wrong(problem).problems
    return None
