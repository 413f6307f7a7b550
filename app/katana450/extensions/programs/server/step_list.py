"""The steps of a program as a list in the panel, with the current one marked."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection
from html import escape
from itertools import accumulate
from typing import NamedTuple

from katana450.extensions.programs.building.actions import expected_time
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.server.state_line import RUNS
from katana450.server.api.answers import Progress

NOTHING = "nothing to do"
"""Name of a step without a task: it is left out, or changes nothing."""


class ListedStep(NamedTuple):
    """A step of a program.

    Attributes:
        name: its name, without the name of an action.
        seconds: its expected duration [s].
        alternative: ``then`` or ``else`` for a step of an alternative, otherwise "".
        predicted: whether it is executed if all is as predicted.
    """

    name: str
    seconds: float
    alternative: str = ""
    predicted: bool = True


def steps_of(program: Program) -> tuple[ListedStep, ...]:
    """Return the steps of ``program`` in their order, with those of all alternatives."""
    names: dict[int, str] = {}
    seconds = [0.0] * program.steps
    times = {task.number: task.end - task.begin for task in program.schedule}
    expected = {program.tasks[number].number for number in times}
    last: dict[int, int] = {}
    # The first task belongs to no step; it sets the speed.
    for number, task in enumerate(program.tasks[1:], 1):
        step = task.number
        # A step after different alternatives is there several times, and listed once.
        is_first = last.get(step, number - 1) == number - 1
        if not (number in times if step in expected else is_first):
            continue
        last[step] = number
        names.setdefault(step, task.name.partition(":")[0])
        seconds[step] += times.get(number, expected_time(task.action, program.speed))
    words = _words(program)
    return tuple(
        ListedStep(names.get(step, NOTHING), seconds[step], words[step], step in expected)
        for step in range(program.steps)
    )


def _words(program: Program) -> list[str]:
    """Return ``then`` or ``else`` for each step of an alternative, and "" for all others."""
    words = [""] * program.steps
    # Inner alternatives come after the outer ones.
    for number, otherwise, end in program.alternatives:
        words[number + 1 : otherwise] = ["then"] * (otherwise - number - 1)
        words[otherwise:end] = ["else"] * (end - otherwise)
    return words


def current_step(
    steps: tuple[ListedStep, ...], progress: Progress | None, look: float
) -> int | None:
    """Return the index of the step that runs, else the one at ``look`` [s] of the preview, if any.

    ``look`` is 0 if no time of the preview is looked at.
    """
    if progress is not None and progress.status in RUNS:
        return progress.step - 1
    if look <= 0.0 or not steps:
        return None
    seconds = (step.seconds if step.predicted else 0.0 for step in steps)
    begins = list(accumulate(seconds, initial=0.0))
    return min(bisect_right(begins, look) - 1, len(steps) - 1)


def page(
    steps: tuple[ListedStep, ...],
    current: int | None,
    breakpoints: Collection[int] = (),
    skipped: Collection[int] = (),
) -> str:
    """Return the list as HTML; the empty string without steps.

    Each step has a button to pause before it, pressed if it is one of the ``breakpoints``, and a
    button to run the program from it. static/scene/steps.js gives the orders. ``skipped``: the
    steps of alternatives that the run has not taken. All are numbers from 1.
    """
    rows = "".join(
        f"<li{_marks(number - 1 == current, number in skipped)}>"
        f"<button name=pause aria-label='Pause before step {number}' title='Pause before this "
        f"step' aria-pressed={'true' if number in breakpoints else 'false'}></button>"
        f"<button name=run aria-label='Run from step {number}' title='Run from this step'>"
        f"</button><span>{escape(_title(step))}</span>"
        f"<span>{'not taken' if number in skipped else _duration(step)}</span></li>"
        for number, step in enumerate(steps, 1)
    )
    return f"<div class='k450'><ol class='steps' tabindex=0>{rows}</ol></div>" if rows else ""


def _marks(current: bool, skipped: bool) -> str:
    """Return the attributes of a row."""
    if current:
        return " aria-current=step"
    return " class=skipped" if skipped else ""


def _title(step: ListedStep) -> str:
    return f"{step.alternative}: {step.name}" if step.alternative else step.name


def _duration(step: ListedStep) -> str:
    return f"{step.seconds:.1f} s" if step.seconds > 0.0 else ""
