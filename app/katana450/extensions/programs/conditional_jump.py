"""The action of the step ``if``: continue with one of two tasks, by a measured condition."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.extensions.programs.conditions import Condition, ProgramTime


@dataclass(frozen=True, eq=False)
class ConditionalJump:
    """Continue with another task, by a condition that is measured at that moment.

    Attributes:
        condition: the condition.
        predicted: whether it holds in the state that the planning predicts; None if that is
            unknown.
        then, otherwise: index of the task that follows if it holds, and if it does not.
    """

    condition: Condition | ProgramTime
    predicted: bool | None
    then: int
    otherwise: int

    def commands(self, speed: float) -> tuple[cmd.Command, ...]:  # noqa: ARG002
        """Return no command."""
        return ()

    def done(self, state: State, waited: float) -> bool:  # noqa: ARG002
        """Return True: it takes no time."""
        return True

    def fraction(self, state: State, waited: float) -> float:  # noqa: ARG002
        """Return 1: it takes no time."""
        return 1.0

    def holds(self, state: State, elapsed: float) -> bool:
        """Return whether the condition holds, ``elapsed`` [s] after the program began."""
        if isinstance(self.condition, ProgramTime):
            return self.condition.bounds.hold(elapsed)
        return self.condition.holds(state)
