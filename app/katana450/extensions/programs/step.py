"""The protocol of a program step."""

from __future__ import annotations

from typing import ClassVar, Protocol, Self

from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.schema_parts import Schema
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue


class Step(Protocol):
    """A program step.

    Attributes:
        schema: JSON Schema of its value, with which editors explain and check it.
    """

    schema: ClassVar[Schema]

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read the step from the value after its name. Raises ScriptError."""
        ...

    def build(self, builder: PlanBuilder) -> None:
        """Append the step's actions, with their plans. Raises InputError if it is not possible."""
        ...


def nothing(value: YamlValue, name: str) -> None:
    """Refuse a value after the step ``name``, which takes none. Raises ScriptError."""
    if value.kind != "nothing":
        raise value.wrong(f"`{name}` takes no value. Remove it.")
