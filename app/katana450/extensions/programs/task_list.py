"""The tasks of a program: the planned steps in one list, in which choices jump forward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from katana450.extensions.programs.actions import SetSpeed, Task
from katana450.extensions.programs.conditional_jump import ConditionalJump
from katana450.extensions.programs.planned_steps import PlannedChoice, PlannedStep, PlannedSteps

AFTER, THEN, OTHERWISE = "after", "then", "otherwise"
"""The ends of a task that lead to another one."""


class _Exit(NamedTuple):
    """An end of a task whose next task is not known yet."""

    task: int
    end: str


class _TaskList:
    """The tasks so far, and the next tasks of their ends."""

    def __init__(self, first: int) -> None:
        self.tasks: list[Task] = [Task(first, 1, "speed", SetSpeed(1.0))]
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
                for name, action in step.actions:
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


def task_list(steps: PlannedSteps) -> tuple[Task, ...]:
    """Return the tasks of ``steps``. The first sets the speed; the others are in their order.

    A task leads only to later ones. The number of tasks stands for the end.
    """
    found = _TaskList(steps[0].number)
    found.join(found.add_steps(steps, (_Exit(0, AFTER),)))
    return found.linked()
