"""Simulation of a program on the real session with a simulated clock, and the trace of the run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.drivers.driver import Driver
from katana450.arm.runtime.tick import driven
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.maths.geometry.arrays import FloatArray, IntArray
from katana450.maths.water.motion import MotionWithWater

MAX_DURATION = 24 * 3600.0
"""[s] Maximum duration of a program."""


@dataclass(frozen=True, eq=False)
class Trace:
    """The record of N ticks, the first before anything moves.

    Attributes:
        t: (N,) [s].
        q: (N, 5) setpoints [rad].
        qd: (N, 5) velocities of the setpoints [rad/s].
        sent: (N, 5) joints that the driver reported, or the setpoints of an arm that is measured
            [rad].
        measured: (N, 5) measured joints [rad]; None for an arm that follows exactly.
        fingers: (N,) finger joint [rad].
        task: (N,) index of the current task of the program.
        segment: (N,) index of the segment of its plan, -1 for none.
        sigma: (N,) place on the path of that segment, from 0 to 1.
        tools: (N,) the tool frame.
        water: (N,) the water, None without water.
        margin: (N,) height of the cup's lip above the water [m]; infinite without water.
    """

    t: FloatArray
    q: FloatArray
    qd: FloatArray
    sent: FloatArray
    measured: FloatArray | None
    fingers: FloatArray
    task: IntArray
    segment: IntArray
    sigma: FloatArray
    tools: tuple[str, ...]
    water: tuple[MotionWithWater | None, ...]
    margin: FloatArray


def simulated(
    program: Program,
    session: Session,
    start: State,
    period: float,
    drive: Callable[[State], State],
) -> Iterator[tuple[State, Run]]:
    """Run ``program`` from ``start``; yield the state and the run after each tick.

    ``period``: of the ticks [s]. ``drive`` gives the setpoint of a state to a driver and returns
    the state with the place of the arm; ``follow_exactly`` does so without a driver. Raises
    InputError if the program takes longer than MAX_DURATION.
    """
    state, run, tick = start, Run(start.t), 0
    while run.phase is Phase.RUNNING:
        tick += 1
        if tick * period > MAX_DURATION:
            raise InputError(f"The program takes more than {MAX_DURATION / 3600.0:g} hours.")
        run, commands = runner.step(program, run, state, state.t)
        state = drive(session.step(state, commands, start.t + tick * period))
        yield state, run


def follow_exactly(state: State) -> State:
    """Return ``state`` of an arm that is at its setpoint."""
    return Session.observe(state, state.setpoint, state.gripper_setpoint)


class Simulation:
    """A run of a program, tick by tick."""

    def __init__(
        self, program: Program, session: Session, driver: Driver, rate: float, start: State
    ) -> None:
        """Prepare a run at ``rate`` [Hz] from ``start``, where the arm of ``driver`` stands."""
        self._program = program
        self._session = session
        self._driver = driver
        self._period = 1.0 / rate
        self._records: list[tuple[State, int]] = []
        self._start = start
        self.run = Run(0.0)

    def ticks(self) -> Iterator[float]:
        """Run the program; yield the completed fraction after each tick, from 0 to 1."""
        start = self._start
        self._driver.start(start.t)
        self._records = [(start, 0)]
        count = len(self._program.tasks)
        ticks = simulated(self._program, self._session, start, self._period, self._driven)
        for state, self.run in ticks:
            self._records.append((state, self.run.number))
            fraction = runner.task_fraction(self._program, self.run, state)
            yield min((self.run.number + fraction) / count, 1.0)

    def _driven(self, state: State) -> State:
        return driven(self._session, state, state.t, self._driver.send)

    @property
    def states(self) -> tuple[State, ...]:
        """The states of all ticks so far."""
        return tuple(state for state, _ in self._records)

    @property
    def trace(self) -> Trace:
        """The trace of the run so far."""
        states = self.states
        tasks = [number for _, number in self._records]
        places = [self._place(state, number) for state, number in self._records]
        q = np.array([state.q for state in states])
        setpoints = np.array([state.setpoint for state in states])
        measured = q if states[-1].report is not None else None
        return Trace(
            t=np.array([state.t for state in states]),
            q=setpoints,
            qd=np.array([state.motion.qd for state in states]),
            sent=q if measured is None else setpoints,
            measured=measured,
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
        following, action = state.following, self._program.tasks[number].action
        if (
            following is None
            or not isinstance(action, FollowPlan)
            or following.plan is not action.plan
        ):
            return -1, 0.0
        return following.number, following.segment.scaling.pace(following.local).sigma
