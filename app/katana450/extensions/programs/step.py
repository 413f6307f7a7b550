"""What every kind of step can do."""

from __future__ import annotations

from typing import Protocol, Self

from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue


class Step(Protocol):
    """One of them."""

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """From what stands behind its name. Raises ScriptError."""
        ...

    def build(self, builder: PlanBuilder) -> None:
        """Note what is to be done, with its plans. Raises InputError where that cannot be."""
        ...


def nothing(value: YamlValue, name: str) -> None:
    """Refuse anything that stands behind a step that says all by its ``name``."""
    if value.kind != "nothing":
        raise value.wrong(f"`{name}` says all there is to say; nothing stands behind it.")
