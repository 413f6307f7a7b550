"""Steps that move no joint: gripper, wait, tool frame and speed."""

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
"""[s] Maximum duration of a wait."""


@dataclass(frozen=True)
class Gripper:
    """Open or close the fingers, or move them to a position [deg], or [mm] for sliding fingers."""

    where: float | str

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read ``open``, ``closed`` or a number. Raises ScriptError."""
        if value.number is not None:
            return cls(read.number(-180.0, 180.0, "deg or mm")(value))
        return cls(read.choice("open", "closed")(value))

    def build(self, builder: PlanBuilder) -> None:
        """Append the finger motion. Raises InputError outside the range of the fingers."""
        fingers = builder.plan_context.arm.gripper
        if not fingers.moves:
            raise InputError("This arm has no fingers.")
        ends = {"open": fingers.upper, "closed": fingers.lower}
        unit, scale = ("mm", 1e-3) if fingers.slides else ("deg", math.radians(1.0))
        angle = ends[self.where] if isinstance(self.where, str) else scale * self.where
        if not fingers.lower <= angle <= fingers.upper:
            low, high = fingers.lower / scale, fingers.upper / scale
            raise InputError(f"The range of the fingers is {low:.1f} to {high:.1f} {unit}.")
        held = replace(builder.state, gripper=angle, gripper_setpoint=angle, gripper_goal=angle)
        builder.note("gripper", MoveFingers(angle), held)


@dataclass(frozen=True)
class TimedPause:
    """Wait for ``seconds`` [s]."""

    seconds: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read a time [s]. Raises ScriptError."""
        return cls(read.number(0.0, MAX_PAUSE, "s")(value))

    def build(self, builder: PlanBuilder) -> None:
        """Append the wait."""
        if self.seconds:
            builder.note("wait", Wait(self.seconds), builder.state)


@dataclass(frozen=True)
class Tool:
    """Select the tool frame to which all later points refer."""

    name: str

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the name of a tool frame. Raises ScriptError."""
        return cls(read.text(value))

    def build(self, builder: PlanBuilder) -> None:
        """Append the change of the tool frame. Raises InputError if it does not exist."""
        builder.plan_context.arm.chain_to(self.name)
        builder.note(
            f"tool {self.name}", UseTool(self.name), replace(builder.state, tool=self.name)
        )


@dataclass(frozen=True)
class Speed:
    """Limit all later motions to the fraction ``value`` of the program's speed."""

    value: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read a fraction. Raises ScriptError."""
        return cls(read.number(MIN_SPEED, 1.0)(value))

    def build(self, builder: PlanBuilder) -> None:
        """Append the change of the speed."""
        builder.note(f"speed {self.value:g}", SetSpeed(self.value), builder.state)


STEPS: dict[str, type[Step]] = {
    "gripper": Gripper,
    "wait": TimedPause,
    "tool": Tool,
    "speed": Speed,
}
"""Steps of this module, by their names in a script."""
