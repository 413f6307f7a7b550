"""The arm, the objects and the water at a time of a program."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from katana450.arm.control.modes import IDLE
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.caching import cached_property
from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.simulation import follow_exactly, simulated
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.motion.limiter import JointMotion
from katana450.maths.planning.plan import Segment

TICK = 0.02
"""[s] Period of the simulation of objects and water."""

MAX_MOMENTS = 3000
"""Maximum number of states that are kept of a simulation."""

TAU_SAMPLES = 65
"""Number of points at which the place on a segment is tabulated by time."""


@dataclass(frozen=True, eq=False)
class Timeline:
    """The motions of a program at full speed, on one clock.

    Pauses between the motions, such as for the gripper, are left out. Of two alternatives it has
    the predicted one.

    Attributes:
        pieces: segments in their order, each with its finger joint [rad].
        begins: start times of the segments and the end of the last [s].
        firsts: index of the first segment of each task of the predicted run, by the index of the
            task; of tasks without motion, that of the next segment.
    """

    pieces: tuple[tuple[Segment, float], ...]
    begins: tuple[float, ...]
    firsts: Mapping[int, int]

    @staticmethod
    def of(program: Program) -> Timeline:
        """Return the timeline of ``program``."""
        pieces: list[tuple[Segment, float]] = []
        firsts: dict[int, int] = {}
        for number in program.predicted:
            firsts[number] = len(pieces)
            action = program.tasks[number].action
            if isinstance(action, FollowPlan):
                plan = action.plan
                pieces += [(segment, plan.fingers) for segment in plan.segments]
        durations = (segment.scaling.duration for segment, _ in pieces)
        begins = tuple(accumulate(durations, initial=0.0))
        return Timeline(tuple(pieces), begins, firsts)

    @property
    def span(self) -> float:
        """The duration [s]."""
        return self.begins[-1]

    def at(self, t: float) -> tuple[FloatArray, float]:
        """Return the joints (5,) and the fingers [rad] at ``t`` [s], from 0 to ``span``.

        The timeline must not be empty.
        """
        number = min(max(bisect_right(self.begins, t) - 1, 0), len(self.pieces) - 1)
        segment, fingers = self.pieces[number]
        return segment.at(segment.scaling.tau_after(t - self.begins[number])).q, fingers

    def postures(self, count: int) -> list[tuple[FloatArray, float]]:
        """Return ``count`` postures (joints and fingers [rad]), evenly spaced in time."""
        return [self.at(t) for t in np.linspace(0.0, self.span, count).tolist()]

    def time_of(self, state: State, task: int) -> float:
        """Return the time [s] of ``state``, in which the program is at its ``task`` on it."""
        first, following = self.firsts[task], state.following
        segment = None if following is None else following.segment
        number = first if following is None else first + following.number
        if following is None or number >= len(self.pieces) or self.pieces[number][0] is not segment:
            # No segment of this task is under way.
            return self.begins[first]
        times, taus = self._tables[number]
        return self.begins[number] + float(np.interp(following.local, taus, times))

    @cached_property
    def _tables(self) -> list[tuple[FloatArray, FloatArray]]:
        """The times since the start of each segment [s], and tau [s] at these."""
        tables = []
        for segment, _ in self.pieces:
            times = np.linspace(0.0, segment.scaling.duration, TAU_SAMPLES)
            tables.append((times, np.array([segment.scaling.tau_after(t) for t in times.tolist()])))
        return tables


class Moment(NamedTuple):
    """A state of the simulation, and its time on the timeline [s]."""

    t: float
    state: State


def moments(
    program: Program, timeline: Timeline, session: Session, state: State
) -> Iterator[Moment]:
    """Simulate ``program`` from ``state``; yield moments at increasing times of ``timeline``.

    Of the time between two motions only the end is yielded. Awaited conditions count as true. A
    program that fails, or takes another alternative than predicted, ends early. One that takes
    longer than a day raises InputError.
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
        if run.number not in timeline.firsts:
            break
        t = max(timeline.time_of(now, run.number), last.t)
        if t > last.t and last.t - yielded >= apart:
            yield last
            yielded = last.t
        last = Moment(t, now)
    yield last
