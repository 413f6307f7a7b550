"""The steps of a program as a list, each marked as done, current or next."""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate
from typing import NamedTuple

from katana450.extensions.programs.building.actions import expected_time
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.server.state_line import ENDED, RUNS
from katana450.server.api.answers import ProgramStep, Progress

SHOWN = "shown"
"""Mark of the step at the time of the preview that is looked at."""

DONE, NOW, NEXT, ENDED_HERE, SKIPPED = "done", "now", "next", "ended here", "skipped"
"""Marks of steps during a run and after it."""


class ListedStep(NamedTuple):
    """A step of a program.

    Attributes:
        name: its name.
        seconds: its expected duration [s].
        predicted: whether it is executed if all is as predicted.
    """

    name: str
    seconds: float
    predicted: bool = True


def planned_steps(
    steps: tuple[ListedStep, ...], progress: Progress | None, look: float
) -> tuple[ProgramStep, ...]:
    """Return ``steps`` as the answer `program_plan` has them; see ``marks``."""
    words = marks(steps, progress, look)
    return tuple(
        ProgramStep(name=step.name, seconds=step.seconds, mark=word)
        for step, word in zip(steps, words, strict=True)
    )


def steps_of(program: Program) -> tuple[ListedStep, ...]:
    """Return the steps of ``program`` in their order, with those of all alternatives."""
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
        seconds[step] += times.get(number, expected_time(task.action, program.speed))
    return tuple(
        ListedStep(title, seconds[step], step in expected)
        for step, title in enumerate(program.titles)
    )


def marks(steps: tuple[ListedStep, ...], progress: Progress | None, look: float) -> tuple[str, ...]:
    """Return the mark of each step; "" for none.

    ``look`` is the time of the preview that is looked at [s]; 0 for none.
    """
    words = [""] * len(steps)
    if progress is None or progress.status not in (*RUNS, *ENDED):
        if look > 0.0 and steps:
            seconds = (step.seconds if step.predicted else 0.0 for step in steps)
            begins = list(accumulate(seconds, initial=0.0))
            words[min(bisect_right(begins, look) - 1, len(steps) - 1)] = SHOWN
        return tuple(words)
    current = progress.step - 1
    for step in range(len(steps)):
        if step + 1 in progress.skipped:
            words[step] = SKIPPED
        elif step < current or progress.status == Phase.DONE.value:
            words[step] = DONE
        elif step == current:
            words[step] = NOW if progress.status in RUNS else ENDED_HERE
        elif NOW in words and NEXT not in words:
            is_expected = steps[step].predicted or not steps[current].predicted
            words[step] = NEXT if is_expected else ""
    return tuple(words)
