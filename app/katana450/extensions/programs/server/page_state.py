"""State line, buttons and list of steps that the page shows of a program."""

from __future__ import annotations

import math
from bisect import bisect_right
from itertools import accumulate
from typing import NamedTuple

import msgspec

from katana450.arm.control.lease import Person
from katana450.arm.control.state.state import State
from katana450.extensions.programs.building.actions import expected_time
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.server.program_planner import PlanningPhase
from katana450.server.api.answers import ProgramStep, Progress
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service.participants import addressed
from katana450.server.service.runner import StatusLine

RUNS = ("running", "paused", "blocked")
"""Statuses of a program that holds the arm, as in `answers.Progress.status`."""

ENDED = (Phase.DONE.value, Phase.STOPPED.value, Phase.FAILED.value)
"""Statuses of a program whose run has ended."""

ENDS = {
    Phase.STOPPED.value: "Ended",
    Phase.FAILED.value: "Failed",
    PlanningPhase.REFUSED.value: "Not possible",
    PlanningPhase.CANCELLED.value: "Not planned",
}
"""The sentence of the page about a program with this status."""

UNPLANNED_ENDS = (Phase.FAILED.value, PlanningPhase.REFUSED.value)
"""The statuses after which somebody has to look at the reason."""

PLANNING, PROGRAM = "planning", "program"
"""The moods of the page while a program is planned, and while it runs."""


class RunNews(NamedTuple):
    """The end of ``run``, or of a planning without one, which ``reader`` does not know yet."""

    run: Run | None
    reader: Person | None


def status_line(
    state: State,
    line: StatusLine,
    program: Progress | None,
    news: RunNews | None = None,
    *,
    waits: bool,
) -> StatusLine:
    """Return the line for ``program`` in place of ``line``, which describes ``state`` alone.

    Args:
        state: the state of the arm.
        line: the line without the program.
        program: the progress of the present or last program.
        news: an end that is news.
        waits: whether the program runs as soon as it is planned.
    """
    if program is None:
        return line
    if program.status in RUNS:
        return _running(state, line, program)
    if program.status == PlanningPhase.PLANNING.value:
        return _planning(state, line, program, waits=waits)
    return line if news is None or state.moving else _ended(line, program, news)


def _running(state: State, line: StatusLine, program: Progress) -> StatusLine:
    """Return the line while ``program`` holds the arm."""
    about = [f"step {program.step} of {program.steps}"]
    if program.seconds_left > 0.0:
        about.append(f"{duration(program.seconds_left)} left")
    if state.paused:
        why = f"{program.name}: {program.task}, {', '.join(about)}. {line.why}"
        return line._replace(why=why.rstrip())
    end = ", ".join(about)
    headline = f"{program.name}: {program.task}, {end}"
    return StatusLine(PROGRAM, headline, line.why, end)


def _planning(state: State, line: StatusLine, program: Progress, *, waits: bool) -> StatusLine:
    """Return the line while ``program`` is planned."""
    headline = f"Planning {program.name or 'the script'}"
    about = [program.why] if program.why else []
    if program.steps:
        about.append(f"Step {program.step} of {program.steps}: {program.task}.")
    if state.moving:
        return line._replace(why=" ".join((f"{headline}.", *about)))
    end = f"{100.0 * program.fraction:.0f} %"
    if state.paused:
        about.insert(0, f"{line.headline}.")
    if waits:
        about.append("Then it waits for Resume." if state.paused else "Then it runs.")
    else:
        about.append("It does not start by itself.")
    return StatusLine(PLANNING, f"{headline} {end}", " ".join(about), end)


def _ended(line: StatusLine, program: Progress, news: RunNews) -> StatusLine:
    """Return the line after the end of ``program``, or of its planning."""
    if program.status == Phase.DONE.value and news.run is not None:
        took = f"in {duration(round(news.run.elapsed))}"
        return line._replace(headline=f"{program.name}: done {took}", end=took)
    if program.status not in ENDS:
        return line
    head = f"{ENDS[program.status]}: {program.name or 'the script'}"
    why = " ".join(program.why.split())
    why = why if news.reader is None else addressed(why, news.reader.name)
    step = f"step {program.step} of {program.steps}" if program.step else ""
    if step and program.status == Phase.STOPPED.value:
        why = f"{why.removesuffix('.')} at {step}."
    elif step:
        why = f"{step.capitalize()}: {why}"
    more = "Continue resumes it there." if program.can_continue else ""
    whys = (why, more, line.why)
    mood = "limited" if program.status in UNPLANNED_ENDS else line.mood
    return StatusLine(mood, head, " ".join(filter(None, whys)))


def duration(seconds: float) -> str:
    """Return a time [s] in words, rounded up to whole seconds."""
    whole = math.ceil(seconds)
    return f"{whole} s" if whole < 100 else f"{whole // 60} min {whole % 60} s"


def orders(program: Progress | None, *, may_begin: bool) -> tuple[str, ...]:
    """Return the orders that the page offers to the owner of ``program``.

    ``may_begin``: whether the arm is not stopped, and free for the owner.
    """
    if program is None:
        return ()
    if program.status in (PlanningPhase.PLANNING.value, *RUNS):
        return (ProgramOrder.END.value,)
    return (ProgramOrder.CONTINUE.value,) if may_begin and program.can_continue else ()


SHOWN, DONE, NOW, NEXT, ENDED_HERE = "shown", "done", "now", "next", "ended here"
SKIPPED = "skipped"
"""Marks of steps: of the one that the preview shows, and during a run and after it."""


def planned_steps(
    steps: tuple[ProgramStep, ...], progress: Progress | None, look: float
) -> tuple[ProgramStep, ...]:
    """Return ``steps`` with their marks; see ``marks``."""
    words = marks(steps, progress, look)
    return tuple(
        msgspec.structs.replace(step, mark=word) for step, word in zip(steps, words, strict=True)
    )


def steps_of(program: Program) -> tuple[ProgramStep, ...]:
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
        ProgramStep(
            name=name,
            seconds=seconds[step],
            predicted=step in expected,
            line=line,
            column=column,
        )
        for step, (name, line, column) in enumerate(program.titles)
    )


def marks(
    steps: tuple[ProgramStep, ...], progress: Progress | None, look: float
) -> tuple[str, ...]:
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
