"""The run of a program: a fold over the states of the arm, the same on any clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import Reason, State
from katana450.errors import InputError
from katana450.extensions.programs.actions import ACTION_TIMEOUT
from katana450.extensions.programs.program import Program


class Phase(Enum):
    """How a run stands; only one that runs goes on."""

    RUNNING = "running"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


@dataclass(frozen=True)
class Run:
    """Attributes:
    number: of the task under way, from 0.
    begun: whether it has been asked for.
    waited: since then, pauses left out [s].
    blocked: for how long the arm has stood before something that is in its way [s].
    t: when it was last looked at [s].
    phase, why: how it stands; why it ended, if not well.
    single: whether it rests after the step under way.
    """

    t: float
    number: int = 0
    started: bool = False
    waited: float = 0.0
    blocked: float = 0.0
    phase: Phase = Phase.RUNNING
    why: str = ""
    single: bool = False


@dataclass(frozen=True)
class Progress:
    """For people. step: from 1, of ``steps``; line: of the script; share: of the step, 0 to 1."""

    step: int
    steps: int
    line: int
    name: str
    fraction: float
    status: str
    why: str


def step(program: Program, run: Run, state: State, t: float) -> tuple[Run, tuple[cmd.Command, ...]]:
    """The run after ``state``, which has all commands in it, and what the arm is told now.

    t: now [s], on the clock of ``run.t``. An arm at rest tells nothing new, so that the time of its
    newest state stands still.
    """
    if run.phase is not Phase.RUNNING:
        return run, ()
    dt, run = t - run.t, replace(run, t=t)
    if state.stopped is not None:
        return replace(run, phase=Phase.STOPPED, why="STOP was pressed."), ()
    if any(finding.reason is Reason.INTERNAL for finding in state.findings):
        return replace(run, phase=Phase.FAILED, why="The arm's controller met an error."), ()
    if state.paused:
        return run, ()
    task = program.tasks[run.number]
    if not run.started:
        return replace(run, started=True, waited=0.0, blocked=0.0), task.order.commands(
            program.speed
        )
    stands = state.blocked and state.motion.at_rest
    run = replace(run, waited=run.waited + dt, blocked=run.blocked + dt if stands else 0.0)
    try:
        if run.blocked > ACTION_TIMEOUT:
            raise InputError(f"The way stays blocked: {_met(state)} would meet.")
        done = task.order.done(state, run.waited)
    except InputError as error:
        why = f"Line {task.line}, {task.name}: {error}"
        return replace(run, phase=Phase.FAILED, why=why), (cmd.Hold(),)
    if not done:
        return run, ()
    if run.number + 1 == len(program.tasks):
        return replace(run, phase=Phase.DONE), ()
    after = replace(run, number=run.number + 1, started=False)
    if run.single and program.tasks[after.number].number != task.number:
        return replace(after, single=False), (cmd.Pause(),)
    return after, ()


def _met(state: State) -> str:
    """What is in whose way."""
    met = [each.parts for each in state.findings if each.reason is Reason.CONTACT]
    return " and ".join(met[0]) if met and met[0] else "something"


def stopped(run: Run, why: str) -> tuple[Run, tuple[cmd.Command, ...]]:
    """Ended by a person: the arm comes to rest where it is."""
    if run.phase is not Phase.RUNNING:
        return run, ()
    return replace(run, phase=Phase.STOPPED, why=why), (cmd.Hold(), cmd.Resume())


def ended(run: Run, phase: Phase, why: str) -> Run:
    """With ``phase`` and ``why``; one that has ended stays as it is."""
    return run if run.phase is not Phase.RUNNING else replace(run, phase=phase, why=why)


def stepping(run: Run) -> tuple[Run, tuple[cmd.Command, ...]]:
    """On, to the end of the step."""
    return replace(run, single=True), (cmd.Resume(),)


def progress(program: Program, run: Run, state: State) -> Progress:
    """How far it is."""
    task = program.tasks[run.number]
    fraction = 1.0 if run.phase is Phase.DONE else 0.0
    if run.started and run.phase is Phase.RUNNING:
        fraction = task.order.fraction(state, run.waited)
    status = run.phase.value
    if run.phase is Phase.RUNNING and state.paused:
        status = "paused"
    elif run.phase is Phase.RUNNING and state.blocked:
        status = "blocked"
    return Progress(task.number + 1, program.steps, task.line, task.name, fraction, status, run.why)
