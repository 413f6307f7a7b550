"""The step ``set_down``: put the held object back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from katana450.arm.control import commands as cmd
from katana450.errors import InputError
from katana450.extensions.programs.actions import MoveFingers
from katana450.extensions.programs.carry import APPROACHES, UP, before, carry
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step, nothing
from katana450.maths.planning.curve import ToolLine
from katana450.maths.planning.plan import MARGIN

SET_DOWN = MARGIN + 2e-4
"""[m] Height above the table at which the fingers release the object."""


@dataclass(frozen=True)
class SetDown:
    """Put the held object back to its place of the grasp, and draw back."""

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:  # noqa: ARG003
        """Read the step, which takes no value. Raises ScriptError."""
        nothing(value, "set_down")
        return cls()

    def build(self, builder: PlanBuilder) -> None:
        """Plan the motions. Raises InputError if nothing is held, or there is no room."""
        taken = builder.taken
        if builder.state.grip is None or taken is None:
            raise InputError("The hand holds no object that this program grasped.")
        at = taken.at
        above = replace(at, position=at.position * (1, 1, 0) + builder.at.position * UP)
        carry(builder, above, "back")
        low = replace(at, position=at.position + SET_DOWN * UP)
        builder.lead([ToolLine(above, low)], "set down")
        opened = builder.plan_context.arm.gripper.upper
        builder.note("let go", MoveFingers(opened), builder.after(cmd.SetGripper(opened)))

        def draw_back(away: float) -> None:
            end = before(low.position, low.pitch, away)
            builder.lead([ToolLine(low, replace(end, roll=low.roll))], "draw back")

        try:
            builder.first(APPROACHES, draw_back)
        except InputError as error:
            raise InputError(f"There is no room to draw back: {error}") from error
        builder.taken = None


STEPS: dict[str, type[Step]] = {"set_down": SetDown}
"""Steps of this module, by their names in a script."""
