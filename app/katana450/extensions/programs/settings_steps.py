"""Steps that move no joint: gripper, wait, tool frame and speed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

from katana450 import tolerances
from katana450.arm.control.commands import MIN_SPEED
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.actions import MoveFingers, SetSpeed, UseTool, Wait
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.finger_planning import finger_unit, with_fingers
from katana450.extensions.programs.place import check_fall
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.schema_parts import (
    OBJECT,
    TEXT,
    Schema,
    any_of,
    mapping,
    number_or_text,
)
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step

MAX_PAUSE = 3600.0
"""[s] Maximum duration of a wait."""


FINGERS = number_or_text(
    -180.0, 180.0, "open, closed, or the angle of the fingers, deg; mm if they slide"
)


@dataclass(frozen=True)
class Gripper:
    """Open or close the fingers, or move them to a position [deg], or [mm] for sliding fingers.

    Attributes:
        where: ``open``, ``closed`` or a position.
        holding: name of the object that they must hold then; "" for any or none.
    """

    schema: ClassVar[Schema] = any_of(
        "open, closed, or the angle of the fingers, deg; mm if they slide",
        FINGERS,
        mapping(
            "A position of the fingers, and what they must hold then",
            "to",
            {"to": FINGERS, "holding": OBJECT},
        ),
    )

    where: float | str
    holding: str = ""

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read ``open``, ``closed``, a number, or {to, holding}. Raises ScriptError."""
        if value.kind != "mapping":
            return cls(_finger_position(value))
        fields = Fields(value, "a gripper step")
        found = cls(fields.need("to", _finger_position, 0.0), fields.take("holding", read.text, ""))
        fields.done()
        return found

    def build(self, builder: PlanBuilder) -> None:
        """Append the finger motion.

        Raises InputError outside the range of the fingers, and if they would not hold what they
        must.
        """
        fingers = builder.plan_context.arm.gripper
        if not fingers.moves:
            raise InputError("This arm has no fingers.")
        ends = {"open": fingers.opened, "closed": fingers.closed}
        unit, scale = finger_unit(builder)
        angle = ends[self.where] if isinstance(self.where, str) else scale * self.where
        if abs(fingers.clamp(angle) - angle) > tolerances.LIMIT_SLACK:
            low, high = fingers.lower / scale, fingers.upper / scale
            raise InputError(f"The range of the fingers is {low:.1f} to {high:.1f} {unit}.")
        angle = fingers.clamp(angle)
        held = with_fingers(builder, angle)
        if self.holding and (held.held is None or held.held.name != self.holding):
            instead = "nothing" if held.held is None else held.held.name
            raise InputError(
                f"The fingers would hold {instead} instead of {self.holding}, which has to stand "
                "where they close."
            )
        if builder.state.held is not None and held.held is None:
            check_fall(builder, builder.state.held)
        builder.note("gripper", MoveFingers(angle, self.holding), held)
        if held.grip is None:
            builder.taken = None


def _finger_position(value: YamlValue) -> float | str:
    """Read ``open``, ``closed`` or a number. Raises ScriptError."""
    if value.number is not None:
        return read.number(-180.0, 180.0, "deg or mm")(value)
    return read.choice("open", "closed")(value)


@dataclass(frozen=True)
class TimedPause:
    """Wait for ``seconds`` [s]."""

    schema: ClassVar[Schema] = number_or_text(0.0, MAX_PAUSE, "Wait, s")

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

    schema: ClassVar[Schema] = {
        **TEXT,
        "description": "Tool frame of all later points: tcp, grasp or flange",
    }

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

    schema: ClassVar[Schema] = number_or_text(
        MIN_SPEED, 1.0, "Fraction of full speed of all later motions"
    )

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
