"""Planning and simulation of a script on a simulated clock, without a server."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.drivers.driver import Driver
from katana450.arm.drivers.simulated import SimulatedDriver
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import describe_robot, find_arm
from katana450.errors import KatanaError
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.run.simulation import Simulation
from katana450.extensions.programs.script.script import Script
from katana450.extensions.progress import progress
from katana450.settings import Settings


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
    robot, session, _ = describe_robot(settings, urdf, None, find_arm)
    plan_context = PlanContext(session, robot.require_arm().T_base_shoulder, seed)
    if begin is None:
        begin = ready if script.scene is None else script.scene.begin
    start = begin(session)
    program = compiled(script, plan_context, start, speed)
    return Planned(script, program, robot, session, start)


def run_by_clock(plan: Planned, driver: Driver | None = None) -> Simulation:
    """Run ``plan`` to its end with a progress bar. Conditions count as true.

    ``driver``: the arm, at the start of the plan; None for one that follows exactly. Raises
    KatanaError if it ends early.
    """
    if driver is None:
        driver = SimulatedDriver(plan.robot.require_arm(), plan.start.q, plan.start.gripper)
    simulation = Simulation(
        plan.program.rehearsed, plan.session, driver, Settings().rate, plan.start
    )
    done, total = 0, 1000
    ticks = progress(range(total), total, plan.script.name)
    for fraction in simulation.ticks():
        while done < int(fraction * total):
            done += 1
            next(ticks, None)
    for _ in ticks:
        pass
    if simulation.run.phase is not Phase.DONE:
        raise KatanaError(simulation.run.why)
    return simulation
