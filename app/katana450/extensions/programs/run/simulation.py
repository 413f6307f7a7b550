"""Planning and simulation of a script on a simulated clock, and its states by time."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.state import State
from katana450.arm.drivers.driver import SimulatedDriver
from katana450.arm.robot.robot import Robot
from katana450.arm.runtime.tick import driven
from katana450.assembly.robot_session import describe_robot
from katana450.caching import cached_property
from katana450.errors import InputError, KatanaError
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.program import ExpectedTask, Program, compiled
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.script.script import Script
from katana450.extensions.progress import progress
from katana450.maths.geometry.arrays import FloatArray, IntArray
from katana450.maths.motion.limiter import JointMotion
from katana450.settings import Settings

MAX_DURATION = 24 * 3600.0
"""[s] Maximum duration of a program."""


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


@dataclass(frozen=True, eq=False)
class Simulation:
    """A complete run of a program, of N ticks, the first before anything moves.

    Attributes:
        program: the program.
        session: the rules of the arm.
        run: the run at its end.
        states: (N,) the states of all ticks.
        tasks: (N,) index of the current task at each.
    """

    program: Program
    session: Session
    run: Run
    states: tuple[State, ...]
    tasks: IntArray

    @property
    def arm(self) -> ArmModel:
        """The arm model."""
        return self.session.require_arm()

    @cached_property
    def t(self) -> FloatArray:
        """The times (N,) [s]."""
        return np.array([state.t for state in self.states])

    @cached_property
    def q(self) -> FloatArray:
        """The setpoints (N, n) [rad]."""
        return np.array([state.setpoint for state in self.states])

    @cached_property
    def qd(self) -> FloatArray:
        """The velocities (N, n) of the setpoints [rad/s]."""
        return np.array([state.motion.qd for state in self.states])

    @cached_property
    def margin(self) -> FloatArray:
        """The height (N,) of the cup's lip above the water [m]; infinite without water."""
        return np.array([self._margin(state) for state in self.states])

    def _margin(self, state: State) -> float:
        pouring = self.session.pouring
        if pouring is None or state.poured is None:
            return math.inf
        return pouring.margin_to_rim(state.poured, state.objects)


class Planned(NamedTuple):
    """A compiled script, the arm that it is for, and the state in which it begins."""

    script: Script
    program: Program
    robot: Robot
    session: Session
    start: State


def ready(session: Session) -> State:
    """Return the state of an arm in its ready posture, with the fingers closed."""
    return session.begin(session.ready, session.require_arm().gripper.clamp(0.0), 0.0)


def plan_script(
    script: Script,
    urdf: Path,
    seed: int = 0,
    speed: float = 1.0,
    begin: Callable[[Session], State] | None = None,
) -> Planned:
    """Return ``script`` planned for the arm of ``urdf``.

    Args:
        script: the script.
        urdf: description of the arm.
        seed: seed of the planner's random search for paths round obstacles.
        speed: fraction of the script's own speed, up to 1.
        begin: returns the state in which the script begins; None for an arm in its ready posture,
            in the scene of the script if it has one.

    Raises ScriptError, and InputError if the arm cannot begin so.
    """
    settings = replace(Settings(), bare=script.bare)
    robot, session, _ = describe_robot(settings, urdf, None)
    plan_context = PlanContext(session, robot.require_arm().T_base_shoulder, seed)
    if begin is None:
        begin = ready if script.scene is None else script.scene.begin
    start = begin(session)
    program = compiled(script, plan_context, start, speed)
    return Planned(script, program, robot, session, start)


def run_by_clock(plan: Planned) -> Simulation:
    """Run ``plan`` to its end with a progress bar. Raises KatanaError if it ends early."""
    driver = SimulatedDriver(plan.robot.require_arm(), plan.start.q, plan.start.gripper)
    driver.start(plan.start.t)
    program, session, period = plan.program, plan.session, 1.0 / Settings().rate

    def drive(state: State) -> State:
        return driven(session, state, state.t, driver.send)

    run, states, tasks = Run(0.0), [plan.start], [0]
    ticks = simulated(program, session, plan.start, period, drive)
    total = math.ceil(program.duration / period) + len(program.tasks)
    for state, run in progress(ticks, total, plan.script.name):
        states.append(state)
        tasks.append(run.number)
    if run.phase is not Phase.DONE:
        raise KatanaError(run.why)
    return Simulation(program, session, run, tuple(states), np.array(tasks, dtype=np.int64))


TICK = 0.02
"""[s] Period of the simulation of objects and water."""

MAX_MOMENTS = 3000
"""Maximum number of states that are kept of a simulation."""


class Moment(NamedTuple):
    """A state of the simulation, and its time on the clock of the program [s]."""

    t: float
    state: State


def moments(program: Program, session: Session, state: State) -> Iterator[Moment]:
    """Simulate ``program`` from ``state``; yield moments at increasing times of its schedule.

    A program that fails, or takes another alternative than predicted, ends early. One that takes
    longer than a day raises InputError.
    """
    at_rest = JointMotion.rest(state.setpoint)
    start = replace(
        state, stopped=None, paused=False, blocked=False, findings=(), mode=IDLE, motion=at_rest,
        goal=state.setpoint, gripper_goal=state.gripper_setpoint,
    )  # fmt: skip
    expected = {task.number: task for task in program.schedule}
    apart = max(TICK, program.duration / MAX_MOMENTS)
    last = Moment(0.0, start)
    yielded = -apart
    for now, run in simulated(program, session, start, TICK, follow_exactly):
        if run.number not in expected:
            break
        t = max(_time_of(program, expected[run.number], run, now), last.t)
        if t > last.t and last.t - yielded >= apart:
            yield last
            yielded = last.t
        last = Moment(t, now)
    yield last


def _time_of(program: Program, task: ExpectedTask, run: Run, state: State) -> float:
    """Return the time [s] of ``state``, in which ``run`` is at ``task``, on the schedule."""
    if run.phase is Phase.DONE:
        return task.end
    if isinstance(program.tasks[task.number].action, FollowPlan):
        return task.begin + runner.task_fraction(program, run, state) * (task.end - task.begin)
    return min(task.begin + run.waited * run.started, task.end)
