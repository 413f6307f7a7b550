"""The steps of a program as a list in the panel, each marked as done, current or next."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection
from html import escape
from itertools import accumulate
from typing import NamedTuple

from katana450.extensions.programs.building.actions import expected_time
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.server.state_line import ENDED, RUNS
from katana450.server.api.answers import Progress

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


def page(
    steps: tuple[ListedStep, ...], words: tuple[str, ...], breakpoints: Collection[int] = ()
) -> str:
    """Return the list with the marks ``words`` as HTML; the empty string without steps.

    Each step has a button to pause before it, pressed if it is one of the ``breakpoints``, which
    are numbers from 1, and a button to run the program from it. static/scene/steps.js gives the
    orders.
    """
    rows = "".join(
        f"<li{_attributes(word)}>"
        f"<button name=pause aria-label='Pause before step {number}' title='Pause before this "
        f"step' aria-pressed={'true' if number in breakpoints else 'false'}></button>"
        f"<button name=run aria-label='Run from step {number}' title='Run from this step'>"
        f"</button><span>{escape(step.name)}</span>"
        f"<span>{' '.join(filter(None, (word, _duration(step, word))))}</span></li>"
        for number, (step, word) in enumerate(zip(steps, words, strict=True), 1)
    )
    return f"<div class='k450'><ol class='steps' tabindex=0>{rows}</ol></div>" if rows else ""


def _attributes(word: str) -> str:
    """Return the attributes of a row with the mark ``word``."""
    if word in (SHOWN, NOW, ENDED_HERE):
        return " aria-current=step"
    return f" class={word}" if word else ""


def _duration(step: ListedStep, word: str) -> str:
    return f"{step.seconds:.1f} s" if step.seconds > 0.0 and word != SKIPPED else ""
