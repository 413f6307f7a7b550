"""Continuation of a program that ended early, at the place on its path where the arm left it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from katana450.arm.control.session.goals import START_TOLERANCE
from katana450.arm.control.state.state import State
from katana450.errors import BlockedError, InputError
from katana450.extensions.programs.building.actions import FollowPlan, MoveFingers, Task, use_tool
from katana450.extensions.programs.building.plan_state import (
    PlanContext,
    PlanState,
    UntimedPath,
)
from katana450.extensions.programs.run.compiler import ConditionalJump
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.run.situation import Situation
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.joint_path import JointPath
from katana450.maths.planning.plan import Plan

BRAKING_TIME = 2.0
"""[s] Maximum time at full speed along the path that the arm brakes for after a stop."""

SAMPLES, REFINEMENTS = 101, 4
"""Number of places that are compared at a time, and of searches, each between the neighbours of the
best place of the one before. Together they find it to 2e-8 s."""

RETURN = "return to the path"
"""Name of the motion from where the arm stands to its path."""


@dataclass(frozen=True, eq=False)
class Interruption:
    """A run that ended before its program.

    Attributes:
        program: the program.
        run: the run; its task was not completed.
        situation: the situation at the end of the run.
    """

    program: Program
    run: Run
    situation: Situation

    @staticmethod
    def of(program: Program, run: Run, state: State) -> Interruption | None:
        """Return the interruption of ``run``, which ended in ``state``; None if it is complete."""
        if run.phase in (Phase.RUNNING, Phase.DONE):
            return None
        return Interruption(program, run, Situation.of(state))

    @property
    def task(self) -> Task:
        """The task that was not completed."""
        return self.program.tasks[self.run.number]

    def changed_to(self, state: State) -> str:
        """Return a clause that names what prevents a continuation from ``state``, else "".

        The arm may have moved, with what it holds, and the water and the tool frame too.
        """
        before, now = self.situation, Situation.of(state)
        fingers = before.fingers if isinstance(self.task.action, MoveFingers) else now.fingers
        # The continuation selects the tool frame of the run.
        now = replace(
            now, posture=before.posture, water=before.water, fingers=fingers, tool=before.tool
        )
        return before.changed_to(now)


def continued(interruption: Interruption, plan_context: PlanContext, state: State) -> Program:
    """Return the rest of the program, with a motion from ``state`` back to its path if needed.

    An interrupted motion is continued at the place of its path that is nearest to the arm, within
    the length of a brake. A wait or a motion of the fingers begins again.

    Raises:
        InputError: something else than the posture has changed.
        BlockedError: the arm holds an object and cannot go straight back to the path, or finds no
            way round obstacles with an empty hand.
    """
    if changed := interruption.changed_to(state):
        raise InputError(f"The program cannot continue: {changed}. Run it again.")
    program, run, task = interruption.program, interruption.run, interruption.task
    # Every other task is done at rest.
    action, q = task.action, interruption.situation.posture
    if isinstance(action, FollowPlan):
        tau = action.tau
        if run.started and run.tau > 0.0:
            tau = _nearest(action.plan, run.tau, state.setpoint)
        q = action.plan.q(tau)
        action = replace(action, tau=tau)
    step = program.titles[task.number][0]
    added = [replace(task, name=f"{step}: speed", action=run.speed, after=None)]
    if interruption.situation.tool not in ("", state.tool):
        tool = use_tool(interruption.situation.tool)
        added.append(replace(task, name=f"{step}: tool", action=tool, after=None))
    if float(np.abs(state.setpoint - q).max()) > START_TOLERANCE:
        way = _way(plan_context, state, q)
        added.append(replace(task, name=RETURN, action=way, after=None))
    changed_tasks = (
        *program.tasks[: run.number], replace(task, action=action), *program.tasks[run.number + 1 :]
    )  # fmt: skip
    moved = [_moved(changed_task, run.number, len(added)) for changed_task in changed_tasks]
    tasks = (*moved[: run.number], *added, *moved[run.number :])
    return replace(program, start=state.setpoint, tasks=tasks, first=run.number)


def _moved(task: Task, number: int, by: int) -> Task:
    """Return ``task``, with the tasks after ``number`` moved back ``by`` places."""

    def place(index: int) -> int:
        return index + by if index > number else index

    if isinstance(task.action, ConditionalJump):
        then, otherwise = place(task.action.then), place(task.action.otherwise)
        return replace(task, action=replace(task.action, then=then, otherwise=otherwise))
    return task if task.after is None else replace(task, after=place(task.after))


def _nearest(plan: Plan, tau: float, q: FloatArray) -> float:
    """Return the place [s] after ``tau`` on ``plan`` that is nearest to ``q`` (5,) [rad].

    It is before the end, so that the motion has a length.
    """
    end = math.nextafter(plan.span, 0.0)
    low, high = min(tau, end), min(tau + BRAKING_TIME, end)
    best = tau
    for _ in range(REFINEMENTS):
        places = np.linspace(low, high, SAMPLES)
        apart = [float(np.abs(plan.q(place) - q).max()) for place in places.tolist()]
        number = _first_nearest(np.array(apart))
        best = float(places[number])
        low, high = float(places[max(number - 1, 0)]), float(places[min(number + 1, SAMPLES - 1)])
    return best


def _first_nearest(apart: FloatArray) -> int:
    """Return the index of the first minimum of ``apart`` (N,) that is as low as the lowest.

    Minima count as equal within the largest change from one sample to the next, because a path that
    leads back the same way passes a place twice.
    """
    padded = np.pad(apart, 1, constant_values=math.inf)
    minima = np.flatnonzero((apart <= padded[:-2]) & (apart <= padded[2:]))
    allowed = float(apart.min()) + float(np.abs(np.diff(apart)).max(initial=0.0))
    return int(minima[apart[minima] <= allowed][0])


def _way(plan_context: PlanContext, state: State, q: FloatArray) -> FollowPlan:
    """Return the motion from ``state`` to ``q`` (5,) [rad].

    With an object in the hand it is straight in the joints, so that the tilt of the object stays
    between those of both ends. Raises BlockedError.
    """
    plan = PlanState(plan_context, state).standing(state.setpoint)
    if state.grip is None:
        plan = plan.move_to(q, RETURN)
    else:
        chain = plan_context.arm.chain_to(state.tool)
        try:
            plan = plan.follow([JointPath(chain, np.array((state.setpoint, q)))], RETURN)
        except BlockedError as error:
            raise BlockedError(
                "The arm holds an object and cannot go straight back to its path. Move it nearer "
                f"to where it was stopped. {error}"
            ) from error
    ((_, action),) = plan.actions
    assert isinstance(action, UntimedPath)
    return action.timed()
