"""The steps of a program as a list in the panel, with the current one marked."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection
from html import escape
from itertools import accumulate
from typing import NamedTuple

from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.server.state_line import RUNS
from katana450.server.api.answers import Progress

SKIPPED = "nothing to do"
"""Name of a step without a task: it is left out, or has nothing to change."""


class ListedStep(NamedTuple):
    """A step of a program.

    Attributes:
        name: its name, without the name of an action.
        seconds: duration of its motions at full speed [s].
    """

    name: str
    seconds: float


def steps_of(program: Program) -> tuple[ListedStep, ...]:
    """Return the steps of ``program`` in their order."""
    names = [SKIPPED] * program.steps
    seconds = [0.0] * program.steps
    # The first task belongs to no step; it sets the speed.
    for task in reversed(program.tasks[1:]):
        names[task.number] = task.name.partition(":")[0]
        if isinstance(task.action, FollowPlan):
            seconds[task.number] += task.action.duration
    return tuple(map(ListedStep, names, seconds))


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
    begins = list(accumulate((step.seconds for step in steps), initial=0.0))
    return min(bisect_right(begins, look) - 1, len(steps) - 1)


def page(
    steps: tuple[ListedStep, ...], current: int | None, breakpoints: Collection[int] = ()
) -> str:
    """Return the list as HTML; the empty string without steps.

    Each step has a button to pause before it, pressed if it is one of the ``breakpoints``, from 1,
    and a button to run the program from it. static/scene/steps.js gives the orders.
    """
    rows = "".join(
        f"<li{' aria-current=step' if number == current else ''}>"
        f"<button name=pause aria-label='Pause before step {number + 1}' title='Pause before "
        f"this step' aria-pressed={'true' if number + 1 in breakpoints else 'false'}></button>"
        f"<button name=run aria-label='Run from step {number + 1}' title='Run from this step'>"
        f"</button><span>{escape(step.name)}</span><span>{_duration(step)}</span></li>"
        for number, step in enumerate(steps)
    )
    return f"<div class='k450'><ol class='steps' tabindex=0>{rows}</ol></div>" if rows else ""


def _duration(step: ListedStep) -> str:
    return f"{step.seconds:.1f} s" if step.seconds > 0.0 else ""
