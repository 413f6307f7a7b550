"""The step that puts what the hand holds back."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

from katana450.arm.control import commands as cmd
from katana450.errors import InputError
from katana450.extensions.programs.bench import Bench
from katana450.extensions.programs.carry import APPROACHES, UP, before, carry
from katana450.extensions.programs.order import Grip
from katana450.extensions.programs.setting import Setting
from katana450.extensions.programs.source import Value
from katana450.extensions.programs.step import Step, nothing
from katana450.maths.planning.curve import ToolLine
from katana450.maths.planning.plan import MARGIN

SET_DOWN = MARGIN + 2e-4
"""[m] Above the table, from where what is set down comes to stand."""


@dataclass(frozen=True)
class SetDown:
    """Put what the hand holds back where it was taken, and draw back."""

    @classmethod
    def read(cls, value: Value, setting: Setting) -> Self:  # noqa: ARG003
        nothing(value, "set_down")
        return cls()

    def lay(self, bench: Bench) -> None:
        taken = bench.taken
        if bench.state.grip is None or taken is None:
            raise InputError("The hand holds nothing that it took in this program.")
        at = taken.at
        above = replace(at, position=at.position * (1, 1, 0) + bench.at.position * UP)
        carry(bench, above, "back")
        low = replace(at, position=at.position + SET_DOWN * UP)
        bench.lead([ToolLine(above, low)], "set down")
        opened = bench.rig.arm.gripper.upper
        bench.note("let go", Grip(opened), bench.after(cmd.SetGripper(opened)))

        def draw_back(away: float) -> None:
            end = before(low.position, low.pitch, away)
            bench.lead([ToolLine(low, replace(end, roll=low.roll))], "draw back")

        try:
            bench.first(APPROACHES, draw_back)
        except InputError as error:
            raise InputError(f"There is no room to draw back: {error}") from error
        bench.taken = None


STEPS: dict[str, type[Step]] = {"set_down": SetDown}
"""Steps of this module, by their names in a script."""
