"""The step ``pick``, which grasps an object and lifts it, and ``stack``, which also places it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.approach import UP
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.grasp import Grasp, grasp_schema
from katana450.extensions.programs.place import PlaceHeld
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.schema_parts import Schema
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step

LIFTS = (0.06, 0.04, 0.025, 0.015)
"""[m] Heights to which an object is lifted, tried from the highest."""


@dataclass(frozen=True)
class Pick(Grasp):
    """Grasp an object, and lift it."""

    schema: ClassVar[Schema] = grasp_schema("Grasp an object, and lift it")

    def build(self, builder: PlanBuilder) -> None:
        """Plan grasp and lifting. Raises InputError if it is not possible."""
        super().build(builder)
        at = builder.target

        def lift(height: float) -> None:
            raised = at.moved(at.position + height * UP)
            builder.lead([builder.planning.line(at, raised)], f"lift {self.name}")

        try:
            builder.first(LIFTS, lift)
        except InputError as error:
            raise error.after(f"{self.name} cannot be lifted") from error


def stacked(value: YamlValue, setting: ScriptContext) -> tuple[Step, Step]:
    """Read {object, on}: the steps that pick an object and place it on another. Raises ScriptError.

    They are two steps, so that the object is picked in another way if it cannot be placed.
    """
    fields = Fields(value, "a stack")
    name, on = (fields.need(each, read.text, "") for each in ("object", "on"))
    fields.done()
    if name == on:
        raise value.wrong(f"{name} cannot stand on itself.")
    return Pick(name), PlaceHeld(None, setting.in_base, on, None)


STEPS: dict[str, type[Step]] = {"pick": Pick}
"""Steps of this module, by their names in a script."""
