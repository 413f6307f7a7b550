"""Execution of a program as a pure fold over the states of the arm, on any clock."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum
from itertools import chain

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.messages import finding_text, part
from katana450.arm.control.state.state import Reason, State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import (
    ACTION_TIMEOUT,
    FollowPlan,
    SetSpeed,
    expected_time,
)
from katana450.extensions.programs.run.compiler import ConditionalJump
from katana450.extensions.programs.run.program import Program
from katana450.server.api.answers import Progress

FULL_SPEED = SetSpeed(1.0)
"""The speed before any task."""


class Phase(Enum):
    """The phase of a run. Only RUNNING can change."""

    RUNNING = "running"
    DONE = "done"
    STOPPED = "stopped"
    FAILED = "failed"


@dataclass(frozen=True)
class Run:
    """The progress of a run.

    Attributes:
        t: time of the last step [s].
        number: index of the current task, from 0.
        started: whether the commands of the task were given.
        waited: time since then, without pauses [s].
        blocked: time for which the arm has been blocked at rest [s].
        phase: phase of the run.
        why: reason of an early end.
        single: whether the run pauses after the current step.
        pauses: indices of the steps before which the run pauses.
        tau: place on the plan of the current task that the arm reached last [s]; 0 on no plan.
        speed: the last speed that a task has set.
        elapsed: time since the run began, with pauses [s].
        choices: index of each step ``if`` so far, and whether its condition held.
        held: whether the fingers held an object at the last step.
    """

    t: float
    number: int = 0
    started: bool = False
    waited: float = 0.0
    blocked: float = 0.0
    phase: Phase = Phase.RUNNING
    why: str = ""
    single: bool = False
    pauses: frozenset[int] = frozenset()
    tau: float = 0.0
    speed: SetSpeed = FULL_SPEED
    elapsed: float = 0.0
    choices: tuple[tuple[int, bool], ...] = ()
    held: bool = False


def step(program: Program, run: Run, state: State, t: float) -> tuple[Run, tuple[cmd.Command, ...]]:
    """Return the run after ``state``, and the commands to give now.

    ``state`` must include all earlier commands. ``t`` is the present time [s] on the clock of
    ``run.t``: an arm at rest publishes no new states, so the time of its newest state stands still.
    """
    if run.phase is not Phase.RUNNING:
        return run, ()
    dt = t - run.t
    run = replace(run, t=t, tau=_tau(program, run, state), elapsed=run.elapsed + dt)
    if state.stopped is not None:
        return replace(run, phase=Phase.STOPPED, why="STOP was pressed."), ()
    if any(finding.reason is Reason.INTERNAL for finding in state.findings):
        return replace(
            run, phase=Phase.FAILED, why="The arm's controller reported an internal error."
        ), ()
    if state.paused:
        return run, ()
    task = program.tasks[run.number]
    if not run.started:
        speed = task.action if isinstance(task.action, SetSpeed) else run.speed
        run = replace(run, started=True, waited=0.0, blocked=0.0, speed=speed)
        return run, task.action.commands(program.speed)
    stands = state.blocked and state.motion.at_rest
    run = replace(run, waited=run.waited + dt, blocked=run.blocked + dt if stands else 0.0)
    try:
        if run.blocked > ACTION_TIMEOUT:
            raise InputError(f"The path is still blocked: {_met(state)} would collide.")
        _check_grip(state, held=run.held)
        done = task.action.done(state, run.waited)
    except InputError as error:
        why = f"Line {task.line}, {task.name}: {error}"
        return replace(run, phase=Phase.FAILED, why=why), (cmd.Hold(),)
    run = replace(run, held=state.held is not None)
    if not done:
        return run, ()
    number = program.next(run.number, state)
    if isinstance(task.action, ConditionalJump):
        run = replace(run, choices=(*run.choices, (task.number, number == task.action.then)))
    if number == len(program.tasks):
        return replace(run, phase=Phase.DONE), ()
    after = replace(run, number=number, started=False, tau=0.0)
    step_after = program.tasks[after.number].number
    if step_after != task.number and (run.single or step_after in run.pauses):
        return replace(after, single=False), (cmd.Pause(),)
    return after, ()


def _tau(program: Program, run: Run, state: State) -> float:
    """Return the place [s] on the plan of the current task; the last one if it was left."""
    action = program.tasks[run.number].action
    following = action.followed(state) if isinstance(action, FollowPlan) and run.started else None
    return run.tau if following is None else following.tau


def follows(program: Program, run: Run, state: State) -> bool:
    """Return whether the arm is on the plan of the current task, if that has begun one."""
    action = program.tasks[run.number].action
    left = run.started and isinstance(action, FollowPlan) and action.followed(state) is None
    return not left


EFFECT_TIME = 0.1
"""[s] Time after which a command of the program has an effect on the states."""


def reached(program: Program, runs: Iterable[tuple[float, Run]], state: State) -> Run | None:
    """Return the run in which ``state`` was reached; None before the first of ``runs``.

    ``runs`` are those with a new task, or with its commands given, with the times of their states
    [s]. A command that ``state`` does not show yet is given again.
    """
    earlier = [(t, run) for t, run in runs if t <= state.t]
    if not earlier or earlier[-1][1].phase is not Phase.RUNNING:
        return None
    t, run = earlier[-1]
    action, since = program.tasks[run.number].action, state.t - t
    shown = isinstance(action, FollowPlan) or since > EFFECT_TIME
    started = run.started and shown and follows(program, run, state)
    run = replace(run, started=started, waited=since if started else 0.0, blocked=0.0)
    return replace(run, tau=_tau(program, run, state), single=False)


def seconds_left(program: Program, run: Run, state: State, allowed: float = 1.0) -> float:
    """Return the expected time until ``run`` ends [s], without pauses.

    Alternatives that are still ahead count as they are predicted. ``allowed`` is the maximum
    fraction of full speed for the tasks to come.
    """
    if run.phase is not Phase.RUNNING:
        return 0.0
    left = None
    # A command for the speed may still be on its way to the arm.
    speed = state.speed if run.started else min(run.speed.scale(program.speed), allowed)
    if run.started:
        action = program.tasks[run.number].action
        left = expected_time(action, speed)
        if isinstance(action, FollowPlan):
            rest = 1.0 - action.fraction(state, run.waited)
            left = min(left, rest * action.plan.duration_at(speed))
        else:
            left = max(left - run.waited, 0.0)
    tasks = program.expected(run.number, speed, begin=run.elapsed, left=left, allowed=allowed)
    return tasks[-1].end - run.elapsed


def skipped(program: Program, run: Run) -> tuple[int, ...]:
    """Return the steps, from 1, that ``run`` leaves out: without a task, or not chosen."""
    held = dict(run.choices)
    others = (
        range(otherwise, end) if held[number] else range(number + 1, otherwise)
        for number, otherwise, end in program.alternatives
        if number in held
    )
    return tuple(step + 1 for step in chain(program.idle, *others))


def _check_grip(state: State, *, held: bool) -> None:
    """Raise InputError if an object was crushed, or slides or has slipped that was ``held``."""
    reasons = (Reason.CRUSHED, *((Reason.SLIDING, Reason.SLIPPED) if held else ()))
    for finding in state.findings:
        if finding.reason in reasons:
            raise InputError(f"{finding_text(finding)}.")


def _met(state: State) -> str:
    """Return the two parts that would collide."""
    pairs = [finding.parts for finding in state.findings if finding.reason is Reason.CONTACT]
    return " and ".join(map(part, pairs[0])) if pairs and pairs[0] else "something"


def stopped(run: Run, why: str) -> tuple[Run, tuple[cmd.Command, ...]]:
    """Return the run as ended by a person, and the commands that bring the arm to rest."""
    if run.phase is not Phase.RUNNING:
        return run, ()
    return replace(run, phase=Phase.STOPPED, why=why), (cmd.Hold(), cmd.Resume())


def ended(run: Run, phase: Phase, why: str) -> Run:
    """Return the run with ``phase`` and ``why``; a run that has ended stays unchanged."""
    return run if run.phase is not Phase.RUNNING else replace(run, phase=phase, why=why)


def task_fraction(program: Program, run: Run, state: State) -> float:
    """Return the completed fraction of the current task, from 0 to 1."""
    if run.started and run.phase is Phase.RUNNING:
        return program.tasks[run.number].action.fraction(state, run.waited)
    return float(run.phase is Phase.DONE)


def progress(
    program: Program, run: Run, state: State, by: str = "", allowed: float = 1.0
) -> Progress:
    """Return the progress of ``run`` in ``state``.

    ``by`` is the name of its owner, and ``allowed`` the maximum fraction of full speed.
    """
    task = program.tasks[run.number]
    status = run.phase.value
    if run.phase is Phase.RUNNING and state.paused:
        status = "paused"
    elif run.phase is Phase.RUNNING and state.blocked:
        status = "blocked"
    return Progress(
        name=program.name,
        by=by,
        status=status,
        step=task.number + 1,
        steps=program.steps,
        line=task.line,
        task=task.name,
        fraction=task_fraction(program, run, state),
        seconds=program.duration,
        seconds_left=seconds_left(program, run, state, allowed),
        why=run.why or " ".join(program.notes),
        skipped=skipped(program, run),
    )
