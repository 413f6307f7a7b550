"""Steps that move the joints, whatever way the tool takes meanwhile."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from katana450.arm.control import commands as cmd
from katana450.extensions.programs import fields as read
from katana450.extensions.programs import places
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.plan_builder import PlanBuilder, StepTarget
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step, nothing
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.joint_path import JointPath

MAX_VIAS = 50


@dataclass(frozen=True)
class Move:
    """Go there freely, round what is in the way."""

    place: StepTarget

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        return cls(places.place(value, setting))

    def build(self, builder: PlanBuilder) -> None:
        builder.move_to(builder.joints_at(self.place), "move")


@dataclass(frozen=True)
class Joints:
    """The same to joint angles."""

    q: FloatArray

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        return cls(places.joints(value))

    def build(self, builder: PlanBuilder) -> None:
        builder.move_to(builder.joints_at(StepTarget(joints=self.q)), "joints")


@dataclass(frozen=True)
class Nudge:
    """Drive one joint on by a relative angle."""

    axis: int
    by: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        fields = Fields(value, "a nudge")
        axis = fields.need("axis", read.whole(1, 5), 1)
        found = cls(axis - 1, fields.need("by", read.degrees(-720.0, 720.0), 0.0))
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        q = cmd.Nudge(self.axis, self.by).targets(builder.q)
        builder.move_to(builder.joints_at(StepTarget(joints=q)), "nudge")


@dataclass(frozen=True)
class Home:
    """The same to the ready posture."""

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        nothing(value, "home")
        return cls()

    def build(self, builder: PlanBuilder) -> None:
        builder.move_to(builder.plan_context.ready, "home")


@dataclass(frozen=True)
class Via:
    """Through places one after another without a rest, their corners rounded."""

    through: tuple[StepTarget, ...]
    blend: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        fields = Fields(value, "a via")
        found = cls(*through(fields, setting))
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        vias = [builder.q]
        at = builder.state
        for each in self.through:
            vias.append(builder.joints_at(each))
            builder.state = builder.standing(vias[-1])
        builder.state = at
        blend = np.full(len(vias) - 2, self.blend)
        builder.follow([JointPath(builder.chain, np.array(vias), blend)], "via")


def through(fields: Fields, setting: ScriptContext) -> tuple[tuple[StepTarget, ...], float]:
    """The places on the way, and how much of half a leg a corner cuts off."""
    each = read.listed(lambda item: places.place(item, setting), 2, MAX_VIAS)
    found: tuple[StepTarget, ...] = fields.need("through", each, ())
    return found, fields.take("blend", read.number(0.01, 1.0), 0.5)


STEPS: dict[str, type[Step]] = {
    "move": Move,
    "joints": Joints,
    "nudge": Nudge,
    "home": Home,
    "via": Via,
}
"""Steps of this module, by their names in a script."""
