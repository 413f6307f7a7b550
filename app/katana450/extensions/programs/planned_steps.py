"""The steps of a script with their actions, as the compiler plans them."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.extensions.programs.actions import Action
from katana450.extensions.programs.conditions import Condition, ProgramTime
from katana450.extensions.programs.located_step import LocatedStep

Actions = list[tuple[str, Action]]
"""The actions of one step, each with its name."""


@dataclass(frozen=True, eq=False)
class PlannedStep:
    """A step with its actions.

    Attributes:
        number: index of the step in the script, from 0.
        located: the step.
        actions: its actions.
    """

    number: int
    located: LocatedStep
    actions: Actions


@dataclass(frozen=True, eq=False)
class PlannedChoice:
    """An ``if`` with the steps of both alternatives, and with those after it if their ends differ.

    Attributes:
        number: index of the step in the script, from 0.
        located: the step.
        condition: its condition for this arm.
        predicted: whether it holds in the state that is predicted; None if that is unknown.
        then, otherwise: the steps that follow if it holds, and if it does not.
    """

    number: int
    located: LocatedStep
    condition: Condition | ProgramTime
    predicted: bool | None
    then: PlannedSteps
    otherwise: PlannedSteps


PlannedSteps = tuple[PlannedStep | PlannedChoice, ...]
"""Steps in their order; what follows the last one is the end, or what follows the ``if``."""
