"""A program run on the real session by a clock of its own, and all that happened meanwhile."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.pouring import MotionWithWater
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.drivers.driver import Driver
from katana450.errors import InputError
from katana450.extensions.programs import runner
from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.runner import Phase, Run
from katana450.maths.geometry.arrays import FloatArray, IntArray

MAX_DURATION = 24 * 3600.0
"""[s] No program goes on for longer."""


@dataclass(frozen=True, eq=False)
class Trace:
    """What each of N ticks was like, the first before anything moves.

    Attributes:
        t: (N,) [s].
        q, qd: (N, 5) what the driver was told, and how fast that moves [rad, rad/s].
        sent: (N, 5) where the driver said the arm is [rad].
        fingers: (N,) [rad].
        task: (N,) which of the program's tasks was under way.
        segment: (N,) on which segment of its plan, -1 on none.
        sigma: (N,) where on that segment's path, from 0 to 1.
        tools: (N,) the tool frame.
        water: (N,) the water, None where there is none.
        margin: (N,) [m] how far the cup's lip is above it; infinite where there is none.
    """

    t: FloatArray
    q: FloatArray
    qd: FloatArray
    sent: FloatArray
    fingers: FloatArray
    task: IntArray
    segment: IntArray
    sigma: FloatArray
    tools: tuple[str, ...]
    water: tuple[MotionWithWater | None, ...]
    margin: FloatArray


class Simulation:
    """One run, a tick at a time."""

    def __init__(self, program: Program, session: Session, driver: Driver, rate: float) -> None:
        """``driver``: of an arm that stands where the program starts. ``rate``: [Hz]."""
        self._program = program
        self._session = session
        self._driver = driver
        self._period = 1.0 / rate
        self._seen: list[tuple[State, int]] = []
        self.run = Run(0.0)

    def ticks(self) -> Iterator[float]:
        """Run it; tells after each tick how much is done, from 0 to 1."""
        sent = self._driver.start(0.0)
        state = self._session.begin(sent.q, sent.gripper, 0.0)
        self._seen = [(state, 0)]
        count = len(self._program.tasks)
        while self.run.phase is Phase.RUNNING:
            t = len(self._seen) * self._period
            if t > MAX_DURATION:
                raise InputError(f"The program takes more than {MAX_DURATION / 3600.0:g} hours.")
            self.run, commands = runner.step(self._program, self.run, state, state.t)
            state = self._session.step(state, commands, t)
            sent = self._driver.send(state.setpoint, state.gripper_setpoint, t)
            state = self._session.observe(state, sent.q, sent.gripper)
            self._seen.append((state, self.run.number))
            fraction = runner.progress(self._program, self.run, state).fraction
            yield min((self.run.number + fraction) / count, 1.0)

    @property
    def states(self) -> tuple[State, ...]:
        """Of every tick so far."""
        return tuple(state for state, _ in self._seen)

    @property
    def trace(self) -> Trace:
        """What happened so far."""
        states = self.states
        tasks = [number for _, number in self._seen]
        places = [self._place(state, number) for state, number in self._seen]
        return Trace(
            t=np.array([state.t for state in states]),
            q=np.array([state.setpoint for state in states]),
            qd=np.array([state.motion.qd for state in states]),
            sent=np.array([state.q for state in states]),
            fingers=np.array([state.gripper for state in states]),
            task=np.array(tasks, dtype=np.int64),
            segment=np.array([segment for segment, _ in places], dtype=np.int64),
            sigma=np.array([sigma for _, sigma in places]),
            tools=tuple(state.tool for state in states),
            water=tuple(state.poured for state in states),
            margin=np.array([self._margin(state) for state in states]),
        )

    def _margin(self, state: State) -> float:
        pouring = self._session.pouring
        if pouring is None or state.poured is None:
            return math.inf
        return pouring.margin_to_rim(state.poured, state.objects)

    def _place(self, state: State, number: int) -> tuple[int, float]:
        following, order = state.following, self._program.tasks[number].order
        if (
            following is None
            or not isinstance(order, FollowPlan)
            or following.plan is not order.plan
        ):
            return -1, 0.0
        return following.number, following.segment.scaling.pace(following.local).sigma
