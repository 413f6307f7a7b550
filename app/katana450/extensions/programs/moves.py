"""Steps that move the joints freely, without a prescribed path of the tool."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar, Self

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.extensions.programs import fields as read
from katana450.extensions.programs import places
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.schema_parts import (
    BLEND,
    BRANCH,
    OFFSET,
    ORIENTATION,
    TURN,
    Schema,
    any_of,
    mapping,
    number_or_text,
    reference,
)
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step, nothing
from katana450.extensions.programs.step_target import StepTarget
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.planning.joint_path import JointPath

MIN_BLEND = 0.01
"""[1] Minimum rounding of a corner that is rounded."""

MAX_VIAS = 50
"""Maximum number of places of one step."""


@dataclass(frozen=True)
class Move:
    """Move to a place on a free path round obstacles.

    Attributes:
        place: the place; with ``by`` its orientation and branch.
        by: (3,) motion of the tool point from its present place [m]; None to move to ``place``.
    """

    schema: ClassVar[Schema] = any_of(
        "Move to a place on any path, round obstacles",
        reference("place"),
        mapping(
            "Move relative to the present place",
            "by",
            {"by": OFFSET, **ORIENTATION, "branch": BRANCH},
        ),
    )

    place: StepTarget
    by: FloatArray | None = None

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read a place, or {by, pitch, roll, yaw, branch}. Raises ScriptError."""
        if value.kind != "mapping" or all(name.held != "by" for name, _ in value.fields):
            return cls(places.place(value, setting))
        fields = Fields(value, "a relative move")
        by = fields.need("by", read.vector(read.millimetres(), partly=True), np.zeros(3))
        angles, branch = places.angles(fields), places.branch(fields)
        fields.done()
        return cls(StepTarget(None, None, angles, branch, setting.in_base), by)

    def build(self, builder: PlanBuilder) -> None:
        """Plan the motion. Raises InputError if the place cannot be reached."""
        place = self.place
        if self.by is not None:
            by = builder.direction(self.by, in_base=place.in_base)
            there = builder.target_at(place)
            q = builder.joints_of(there.moved(frozen(there.position + by)), place.branch)
        else:
            q = builder.joints_at(place)
        builder.move_to(q, "move")


@dataclass(frozen=True)
class Joints:
    """Move to the joint angles ``q`` (n,) [rad] on a free path round obstacles."""

    schema: ClassVar[Schema] = reference(
        "joints", "Move to these angles of the joints, deg, round obstacles"
    )

    q: FloatArray

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the joint angles. Raises ScriptError."""
        return cls(places.joints(value))

    def build(self, builder: PlanBuilder) -> None:
        """Plan the motion. Raises InputError if the angles are outside the limits."""
        builder.move_to(builder.joints_at(StepTarget(joints=self.q)), "joints")


@dataclass(frozen=True)
class Nudge:
    """Move the joint ``axis`` (from 0) by the relative angle ``by`` [rad]."""

    schema: ClassVar[Schema] = mapping(
        "Turn one joint by an angle",
        "axis by",
        {"axis": number_or_text(1, places.MAX_JOINTS, "Number of the joint, from 1"), "by": TURN},
    )

    axis: int
    by: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read {axis, by}. Raises ScriptError."""
        fields = Fields(value, "a nudge")
        axis = fields.need("axis", read.whole(1, places.MAX_JOINTS), 1)
        found = cls(axis - 1, fields.need("by", read.angle(-720.0, 720.0), 0.0))
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Plan the motion. Raises InputError if the angle is outside the limits."""
        q = cmd.Nudge(self.axis + 1, self.by).targets(builder.q)
        builder.move_to(builder.joints_at(StepTarget(joints=q)), "nudge")


@dataclass(frozen=True)
class Home:
    """Move to the ready posture on a free path round obstacles."""

    schema: ClassVar[Schema] = {"type": "null", "description": "Move to the ready posture"}

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the step, which takes no value. Raises ScriptError."""
        nothing(value, "home")
        return cls()

    def build(self, builder: PlanBuilder) -> None:
        """Plan the motion."""
        builder.move_to(builder.plan_context.ready, "home")


@dataclass(frozen=True)
class Via:
    """Move through places, without a rest if the corners are rounded."""

    schema: ClassVar[Schema] = mapping(
        "Move the joints through places, with rounded corners",
        "through",
        {"through": reference("through"), "blend": BLEND},
    )

    through: tuple[StepTarget, ...]
    blend: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read {through, blend}. Raises ScriptError."""
        fields = Fields(value, "a via")
        found = cls(*through(fields, setting))
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Plan the motion. Raises InputError if a place cannot be reached."""
        vias = [builder.q]
        at = builder.state
        for each in self.through:
            vias.append(builder.joints_at(each))
            builder.state = builder.standing(vias[-1])
        builder.state = at
        if self.blend:
            blend = np.full(len(vias) - 2, self.blend)
            builder.follow([JointPath(builder.chain, np.array(vias), blend)], "via")
        else:
            legs = [np.array(leg) for leg in pairwise(vias)]
            builder.follow([JointPath(builder.chain, leg, np.zeros(0)) for leg in legs], "via")


def through(fields: Fields, setting: ScriptContext) -> tuple[tuple[StepTarget, ...], float]:
    """Return the places, and the fraction of half a leg that a rounded corner cuts off.

    With 0 the tool rests in each corner.
    """
    each = read.listed(lambda item: places.place(item, setting), 2, MAX_VIAS)
    found: tuple[StepTarget, ...] = fields.need("through", each, ())
    return found, fields.take("blend", _blend, 0.5)


def _blend(value: YamlValue) -> float:
    found = read.number(0.0, 1.0)(value)
    if 0.0 < found < MIN_BLEND:
        raise value.wrong(f"A blend is 0, or {MIN_BLEND:g} to 1: {found:g} is too small to drive.")
    return found


STEPS: dict[str, type[Step]] = {
    "move": Move,
    "joints": Joints,
    "nudge": Nudge,
    "home": Home,
    "via": Via,
}
"""Steps of this module, by their names in a script."""
