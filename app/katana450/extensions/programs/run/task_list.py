"""The tasks of a program: the planned steps in one list, in which choices jump forward."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from katana450.arm.control.state import State
from katana450.extensions.programs.building.actions import Action, SetSpeed, Task
from katana450.extensions.programs.building.conditions import Condition, ProgramTime
from katana450.extensions.programs.building.plan_state import UntimedPath
from katana450.extensions.programs.building.step import LocatedStep


@dataclass(frozen=True, eq=False)
class ConditionalJump(Action):
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

    def holds(self, state: State, elapsed: float) -> bool:
        """Return whether the condition holds, ``elapsed`` [s] after the program began."""
        if isinstance(self.condition, ProgramTime):
            return self.condition.has(elapsed)
        return self.condition.holds(state)


@dataclass(frozen=True, eq=False)
class PlannedStep:
    """A step with its actions.

    Attributes:
        number: index of the step in the script, from 0.
        located: the step.
        actions: its actions, each with its name; their paths may not be timed yet.
        used: number of steps of the script that it stands for.
    """

    number: int
    located: LocatedStep
    actions: Sequence[tuple[str, Action | UntimedPath]]
    used: int = 1


@dataclass(frozen=True, eq=False)
class PlannedChoice:
    """An ``if`` with the steps of both alternatives, and with those after it if their ends differ.

    Attributes:
        number: index of the step in the script, from 0.
        located: the step.
        condition: its condition for this arm.
        predicted: whether it holds in the state that is predicted; None if that is unknown.
        then, otherwise: the steps that follow if it holds, and if it does not.
        used: number of steps of the script that it stands for, the ``if`` and those after it.
    """

    number: int
    located: LocatedStep
    condition: Condition | ProgramTime
    predicted: bool | None
    then: PlannedSteps
    otherwise: PlannedSteps
    used: int


PlannedSteps = Sequence[PlannedStep | PlannedChoice]
"""Steps in their order; what follows the last one is the end, or what follows the ``if``."""


AFTER, THEN, OTHERWISE = "after", "then", "otherwise"
"""The ends of a task that lead to another one."""


TimedActions = Callable[[PlannedStep], Iterable[tuple[str, Action]]]
"""A function that returns the actions of a step with all paths timed. It raises ScriptError."""


class _Exit(NamedTuple):
    """An end of a task whose next task is not known yet."""

    task: int
    end: str


class _TaskList:
    """The tasks so far, and the next tasks of their ends."""

    def __init__(self, first: int, timed: TimedActions) -> None:
        self.tasks: list[Task] = [Task(first, 1, "speed", SetSpeed(1.0))]
        self._timed = timed
        self.next: dict[_Exit, int] = {}

    def add(self, task: Task, exits: Sequence[_Exit]) -> int:
        """Append ``task``, to which ``exits`` lead, and return its index."""
        self.join(exits)
        self.tasks.append(task)
        return len(self.tasks) - 1

    def join(self, exits: Sequence[_Exit]) -> None:
        """Let ``exits`` lead to the task that is appended next."""
        self.next.update(dict.fromkeys(exits, len(self.tasks)))

    def add_steps(self, steps: PlannedSteps, exits: Sequence[_Exit]) -> Sequence[_Exit]:
        """Append the tasks of ``steps``, to which ``exits`` lead, and return the exits of these."""
        for step in steps:
            if isinstance(step, PlannedStep):
                for name, action in self._timed(step):
                    task = Task(step.number, step.located.script_line, name, action)
                    exits = (_Exit(self.add(task, exits), AFTER),)
            else:
                exits = self._add_choice(step, exits)
        return exits

    def _add_choice(self, step: PlannedChoice, exits: Sequence[_Exit]) -> Sequence[_Exit]:
        jump = ConditionalJump(step.condition, step.predicted, 0, 0)
        name = f"if {step.condition.awaited}"
        at = self.add(Task(step.number, step.located.script_line, name, jump), exits)
        then = self.add_steps(step.then, (_Exit(at, THEN),))
        return (*then, *self.add_steps(step.otherwise, (_Exit(at, OTHERWISE),)))

    def linked(self) -> tuple[Task, ...]:
        """Return the tasks with the indices of those that follow."""
        found = []
        for number, task in enumerate(self.tasks):
            action = task.action
            if isinstance(action, ConditionalJump):
                then, otherwise = (self.next[_Exit(number, end)] for end in (THEN, OTHERWISE))
                found.append(replace(task, action=replace(action, then=then, otherwise=otherwise)))
            else:
                after = self.next[_Exit(number, AFTER)]
                found.append(task if after == number + 1 else replace(task, after=after))
        return tuple(found)


def task_list(steps: PlannedSteps, timed: TimedActions) -> tuple[Task, ...]:
    """Return the tasks of ``steps``. The first sets the speed; the others are in their order.

    A task leads only to later ones. The number of tasks stands for the end.
    """
    found = _TaskList(steps[0].number, timed)
    found.join(found.add_steps(steps, (_Exit(0, AFTER),)))
    return found.linked()
