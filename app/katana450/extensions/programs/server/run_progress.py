"""The progress of a run, as the state reports it."""

from __future__ import annotations

from katana450.arm.control.state import State
from katana450.extensions.programs import runner
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.runner import Run
from katana450.server.api import answers


def run_progress(
    program: Program, run: Run, state: State, by: str, allowed: float
) -> answers.Progress:
    """Return the progress of ``run`` of ``program`` in ``state``.

    ``by`` is the name of the owner, and ``allowed`` the maximum fraction of full speed.
    """
    now = runner.progress(program, run, state)
    return answers.Progress(
        name=program.name,
        by=by,
        status=now.status,
        step=now.step,
        steps=now.steps,
        line=now.line,
        task=now.name,
        fraction=now.fraction,
        seconds=program.duration,
        seconds_left=runner.seconds_left(program, run, state, allowed),
        why=now.why or " ".join(program.notes),
        skipped=runner.skipped(program, run),
    )
