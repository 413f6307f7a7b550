"""The arm, the objects and the water at a time of a program."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from katana450.arm.control.modes import IDLE
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.caching import cached_property
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.run.program import ExpectedTask, Program
from katana450.extensions.programs.run.runner import Run
from katana450.extensions.programs.run.simulation import follow_exactly, simulated
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.planning.plan import Segment

TICK = 0.02
"""[s] Period of the simulation of objects and water."""

MAX_MOMENTS = 3000
"""Maximum number of states that are kept of a simulation."""

TAU_SAMPLES = 65
"""Number of points at which the place on a segment is tabulated by time."""


class Piece(NamedTuple):
    """A segment of a plan on the timeline.

    Attributes:
        begin: time at which it begins [s].
        speed: fraction of full speed.
        segment: the segment.
        fingers: the finger joint [rad].
    """

    begin: float
    speed: float
    segment: Segment
    fingers: float


@dataclass(frozen=True, eq=False)
class Timeline:
    """The motions of a program on the clock of its schedule: at its speeds, with its waits.

    Of two alternatives it has the predicted one.

    Attributes:
        pieces: the segments in their order. Between them the arm rests.
        firsts: index of the first segment of each task with a motion, by the index of the task.
        schedule: the tasks of the predicted run, by their index.
        span: the duration [s].
    """

    pieces: tuple[Piece, ...]
    firsts: Mapping[int, int]
    schedule: Mapping[int, ExpectedTask]
    span: float

    @staticmethod
    def of(program: Program) -> Timeline:
        """Return the timeline of ``program``."""
        pieces: list[Piece] = []
        firsts: dict[int, int] = {}
        for task in program.schedule:
            action, begin = program.tasks[task.number].action, task.begin
            if isinstance(action, FollowPlan):
                firsts[task.number] = len(pieces)
                for segment in action.plan.segments:
                    pieces.append(Piece(begin, task.speed, segment, action.plan.fingers))
                    begin += segment.scaling.duration_at(task.speed)
        schedule = {task.number: task for task in program.schedule}
        return Timeline(tuple(pieces), firsts, schedule, program.schedule[-1].end)

    def at(self, t: float) -> tuple[FloatArray, float]:
        """Return the joints (5,) and the fingers [rad] at ``t`` [s], from 0 to ``span``.

        The timeline must not be empty.
        """
        number = max(bisect_right(self.pieces, t, key=lambda piece: piece.begin) - 1, 0)
        begin, speed, segment, fingers = self.pieces[number]
        return segment.at(segment.scaling.tau_after(t - begin, speed)).q, fingers

    def postures(self, count: int) -> list[tuple[FloatArray, float]]:
        """Return ``count`` postures (joints and fingers [rad]), evenly spaced in time."""
        return [self.at(t) for t in np.linspace(0.0, self.span, count).tolist()]

    def time_of(self, state: State, run: Run) -> float:
        """Return the time [s] of ``state`` on it, in which the program is at a task of ``run``."""
        task, first = self.schedule[run.number], self.firsts.get(run.number)
        following = state.following
        if first is None:
            return min(task.begin + run.waited * run.started, task.end)
        number = first if following is None else first + following.number
        piece = self.pieces[min(number, len(self.pieces) - 1)]
        if following is None or piece.segment is not following.segment:
            # No segment of this task is under way.
            return task.begin
        times, taus = self._tables[number]
        return piece.begin + float(np.interp(following.local, taus, times))

    @cached_property
    def _tables(self) -> list[tuple[FloatArray, FloatArray]]:
        """The times since the start of each segment [s], and tau [s] at these."""
        tables = []
        for _, speed, segment, _ in self.pieces:
            scaling = segment.scaling
            times = np.linspace(0.0, scaling.duration_at(speed), TAU_SAMPLES)
            taus = np.array([scaling.tau_after(t, speed) for t in times.tolist()])
            tables.append((times, taus))
        return tables


class Moment(NamedTuple):
    """A state of the simulation, and its time on the timeline [s]."""

    t: float
    state: State


def moments(
    program: Program, timeline: Timeline, session: Session, state: State
) -> Iterator[Moment]:
    """Simulate ``program`` from ``state``; yield moments at increasing times of ``timeline``.

    Awaited conditions count as true. A program that fails, or takes another alternative than
    predicted, ends early. One that takes longer than a day raises InputError.
    """
    at_rest = JointMotion.rest(state.setpoint)
    start = replace(
        state, stopped=None, paused=False, blocked=False, findings=(), mode=IDLE, motion=at_rest,
        goal=state.setpoint, gripper_goal=state.gripper_setpoint,
    )  # fmt: skip
    apart = max(TICK, timeline.span / MAX_MOMENTS)
    last = Moment(0.0, start)
    yielded = -apart
    for now, run in simulated(program.rehearsed, session, start, TICK, follow_exactly):
        if run.number not in timeline.schedule:
            break
        t = max(timeline.time_of(now, run), last.t)
        if t > last.t and last.t - yielded >= apart:
            yield last
            yielded = last.t
        last = Moment(t, now)
    yield last
