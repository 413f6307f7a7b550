"""Steps that move no joint: the fingers, a wait, and how the rest is done."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

from katana450.arm.control.commands import MIN_SPEED
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.actions import MoveFingers, SetSpeed, UseTool, Wait
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step

MAX_PAUSE = 3600.0
"""[s]"""


@dataclass(frozen=True)
class Gripper:
    """Open or close the fingers, or bring them to a place: [deg], or [mm] where they slide."""

    where: float | str

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        if value.number is not None:
            return cls(read.number(-180.0, 180.0, "deg or mm")(value))
        return cls(read.choice("open", "closed")(value))

    def build(self, builder: PlanBuilder) -> None:
        fingers = builder.plan_context.arm.gripper
        if not fingers.moves:
            raise InputError("This arm has no fingers.")
        ends = {"open": fingers.upper, "closed": fingers.lower}
        unit, scale = ("mm", 1e-3) if fingers.slides else ("deg", math.radians(1.0))
        angle = ends[self.where] if isinstance(self.where, str) else scale * self.where
        if not fingers.lower <= angle <= fingers.upper:
            low, high = fingers.lower / scale, fingers.upper / scale
            raise InputError(f"The fingers go from {low:.1f} to {high:.1f} {unit}.")
        held = replace(builder.state, gripper=angle, gripper_setpoint=angle, gripper_goal=angle)
        builder.note("gripper", MoveFingers(angle), held)


@dataclass(frozen=True)
class TimedPause:
    """Wait for a time [s]."""

    seconds: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        return cls(read.number(0.01, MAX_PAUSE, "s")(value))

    def build(self, builder: PlanBuilder) -> None:
        builder.note("wait", Wait(self.seconds), builder.state)


@dataclass(frozen=True)
class Tool:
    """From now on points are of this tool frame."""

    name: str

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        return cls(read.text(value))

    def build(self, builder: PlanBuilder) -> None:
        builder.plan_context.arm.chain_to(self.name)
        builder.note(
            f"tool {self.name}", UseTool(self.name), replace(builder.state, tool=self.name)
        )


@dataclass(frozen=True)
class Speed:
    """From now on no faster than this fraction of the most."""

    value: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        return cls(read.number(MIN_SPEED, 1.0)(value))

    def build(self, builder: PlanBuilder) -> None:
        builder.note(f"speed {self.value:g}", SetSpeed(self.value), builder.state)


STEPS: dict[str, type[Step]] = {
    "gripper": Gripper,
    "wait": TimedPause,
    "tool": Tool,
    "speed": Speed,
}
"""Steps of this module, by their names in a script."""
