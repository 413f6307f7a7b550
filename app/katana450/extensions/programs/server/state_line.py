"""The state line and the buttons of the page while a program is planned or runs."""

from __future__ import annotations

from katana450.arm.control.state import State
from katana450.extensions.programs.requests import ProgramOrder
from katana450.extensions.programs.server.program_planning import PlanningPhase
from katana450.server.api.answers import Progress
from katana450.server.service.runner import StatusLine

RUNS = ("running", "paused", "blocked")
"""Statuses of a program that holds the arm, as in `answers.Progress.status`."""

PLANNING = "planning"
"""The mood of the page while a program is planned."""


def status_line(
    state: State, line: StatusLine, program: Progress | None, *, waits: bool
) -> StatusLine:
    """Return the line for ``program`` in place of ``line``, which describes ``state`` alone.

    ``waits``: whether the program runs as soon as it is planned.
    """
    if program is None:
        return line
    step = f"Step {program.step} of {program.steps}"
    if program.status in RUNS:
        if program.unattended:
            line = line._replace(why=f"{_unattended(program)} {line.why}".rstrip())
        if state.paused:
            return line._replace(headline=f"{program.name}, paused", why=f"{step}. {line.why}")
        return line._replace(mood="moving", headline=f"{program.name}, {step.lower()}")
    if program.status != PlanningPhase.PLANNING.value:
        return line
    headline = f"Planning {program.name or 'the script'}"
    about = [program.why] if program.why else []
    if program.steps:
        about.append(f"{step}: {program.task}, {program.fraction:.0%}.")
    if state.moving:
        return line._replace(why=" ".join((f"{headline}.", *about)))
    headline += ", paused" if state.paused else f" {program.fraction:.0%}"
    if waits:
        about.append("Then it waits for Resume." if state.paused else "Then it runs.")
    else:
        about.append("It does not start by itself.")
    return StatusLine(PLANNING, headline, " ".join(about))


def _unattended(program: Progress) -> str:
    """Return a sentence on who started an unattended program, and when."""
    at = "" if program.began is None else f" at {program.began[11:16]} UTC"
    return f"Unattended: started by {program.by}{at}."


def orders(
    state: State, program: Progress | None, *, stopped: bool, waits: bool
) -> tuple[ProgramOrder, ...]:
    """Return the orders that the page offers to the owner of ``program``.

    ``waits``: whether the program runs as soon as it is planned.
    """
    if program is None:
        return ()
    pause = () if stopped else (ProgramOrder.RESUME if state.paused else ProgramOrder.PAUSE,)
    if program.status == PlanningPhase.PLANNING.value:
        return (*(pause if waits else ()), ProgramOrder.END)
    return (*pause, ProgramOrder.END) if program.status in RUNS else ()
