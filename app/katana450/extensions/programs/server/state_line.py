"""The state line and the buttons of the page while a program is planned or runs."""

from __future__ import annotations

import math

from katana450.arm.control.state import State
from katana450.extensions.programs.requests import ProgramOrder
from katana450.extensions.programs.server.program_planning import PlanningPhase
from katana450.server.api.answers import Progress
from katana450.server.service.runner import StatusLine

RUNS = ("running", "paused", "blocked")
"""Statuses of a program that holds the arm, as in `answers.Progress.status`."""

PLANNING, PROGRAM = "planning", "program"
"""The moods of the page while a program is planned, and while it runs."""


def status_line(
    state: State, line: StatusLine, program: Progress | None, *, waits: bool
) -> StatusLine:
    """Return the line for ``program`` in place of ``line``, which describes ``state`` alone.

    ``waits``: whether the program runs as soon as it is planned.
    """
    if program is None:
        return line
    if program.status in RUNS:
        return _running(state, line, program)
    if program.status == PlanningPhase.PLANNING.value:
        return _planning(state, line, program, waits=waits)
    return line


def _running(state: State, line: StatusLine, program: Progress) -> StatusLine:
    """Return the line while ``program`` holds the arm."""
    about = [f"step {program.step} of {program.steps}"]
    if program.seconds_left > 0.0:
        about.append(f"{duration(program.seconds_left)} left")
    whys = [_unattended(program)] if program.unattended else []
    if state.paused:
        whys.append(f"{program.name}: {program.task}, {', '.join(about)}.")
        return line._replace(why=" ".join((*whys, line.why)).rstrip())
    end = ", ".join(about)
    headline = f"{program.name}: {program.task}, {end}"
    return StatusLine(PROGRAM, headline, " ".join((*whys, line.why)).strip(), end)


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


def duration(seconds: float) -> str:
    """Return a time [s] in words, rounded up to whole seconds."""
    whole = math.ceil(seconds)
    return f"{whole} s" if whole < 100 else f"{whole // 60} min {whole % 60} s"


def _unattended(program: Progress) -> str:
    """Return a sentence on who started an unattended program, and when."""
    at = "" if program.began is None else f" at {program.began[11:16]} UTC"
    return f"Unattended: started by {program.by}{at}."


def orders(program: Progress | None, *, may_begin: bool) -> tuple[str, ...]:
    """Return the orders that the page offers to the owner of ``program``.

    ``may_begin``: whether the arm is not stopped, and free for the owner.
    """
    if program is None:
        return ()
    if program.status in (PlanningPhase.PLANNING.value, *RUNS):
        return (ProgramOrder.END.value,)
    return (ProgramOrder.CONTINUE.value,) if program.can_continue and may_begin else ()
