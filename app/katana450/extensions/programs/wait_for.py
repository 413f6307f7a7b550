"""The step ``wait_for``: wait at rest until a condition holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs import fields as read
from katana450.extensions.programs.conditions import CONDITIONS, Condition, one_condition
from katana450.extensions.programs.fields import Fields
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.schema_parts import (
    CONDITION_FIELDS,
    Schema,
    mapping,
    number_or_text,
)
from katana450.extensions.programs.script_context import ScriptContext
from katana450.extensions.programs.settings_steps import MAX_PAUSE
from katana450.extensions.programs.source import YamlValue
from katana450.extensions.programs.step import Step

TIMEOUT = 60.0
"""[s] Timeout unless the script gives one."""


@dataclass(frozen=True, eq=False)
class WaitUntil:
    """Wait at rest until ``condition`` holds, for at most ``timeout`` [s].

    ``assumed``: whether it counts as true, for a simulation in which nobody makes it true.
    """

    condition: Condition
    timeout: float
    assumed: bool = False

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        """Return no command."""
        return ()

    def done(self, state: State, waited: float) -> bool:
        """Return whether the condition holds. Raises InputError after the timeout."""
        if self.assumed or self.condition.holds(state):
            return True
        if waited > self.timeout:
            raise InputError(f"The condition did not hold within {self.timeout:g} s.")
        return False

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        """Return the fraction of the timeout that has passed."""
        return min(waited / self.timeout, 1.0)


@dataclass(frozen=True)
class WaitFor:
    """Wait until ``condition`` holds; the program fails after ``timeout`` [s].

    The steps after it are planned for the scene as it is when the script is planned.
    """

    schema: ClassVar[Schema] = {
        **mapping(
            "Wait at rest until one condition holds",
            "",
            {
                **CONDITION_FIELDS,
                "timeout": number_or_text(0.01, MAX_PAUSE, "s; 60 unless given"),
            },
        ),
        "minProperties": 1,
        "maxProperties": 2,
    }

    condition: Condition | None
    timeout: float

    @classmethod
    def read(cls, value: YamlValue, setting: ScriptContext) -> Self:
        """Read one condition and a timeout. Raises ScriptError."""
        fields = Fields(value, "a wait_for")
        timeout = fields.take("timeout", read.number(0.01, MAX_PAUSE, "s"), TIMEOUT)
        condition = one_condition(fields, CONDITIONS, setting)
        fields.done()
        return cls(condition, timeout)

    def build(self, builder: PlanBuilder) -> None:
        """Append the wait. Raises InputError if the condition can never hold."""
        assert self.condition is not None
        action = WaitUntil(self.condition.checked(builder), self.timeout)
        builder.note(f"wait for {self.condition.awaited}", action, builder.state)


STEPS: dict[str, type[Step]] = {"wait_for": WaitFor}
"""Steps of this module, by their names in a script."""
