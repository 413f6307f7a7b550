"""Planning and simulation of a script on a simulated clock, without a server."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from katana450.arm.control.session import Session
from katana450.arm.drivers.simulated import SimulatedDriver
from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_session import describe_robot
from katana450.errors import KatanaError
from katana450.extensions.programs.plan_builder import PlanContext
from katana450.extensions.programs.program import Program, compiled
from katana450.extensions.programs.runner import Phase
from katana450.extensions.programs.script import Script
from katana450.extensions.programs.simulation import Simulation
from katana450.extensions.progress import progress
from katana450.settings import Settings


class Planned(NamedTuple):
    """A compiled script, and the arm that it is for."""

    script: Script
    program: Program
    robot: Robot
    session: Session


def plan_script(script: Script, urdf: Path, seed: int = 0, speed: float = 1.0) -> Planned:
    """Return ``script`` planned for the arm of ``urdf``, from its ready posture.

    ``seed`` is the seed of the planner's random search for paths round obstacles. ``speed`` is the
    fraction of the script's own speed, up to 1. Raises ScriptError.
    """
    settings = replace(Settings(), bare=script.bare)
    robot, session, _ = describe_robot(settings, urdf, None)
    plan_context = PlanContext(session, robot.require_arm().T_base_shoulder, seed)
    start = session.begin(session.ready, session.require_arm().gripper.clamp(0.0), 0.0)
    program = compiled(script, plan_context, start, speed)
    return Planned(script, program, robot, session)


def run_by_clock(plan: Planned) -> Simulation:
    """Run ``plan`` to its end with a progress bar. Raises KatanaError if it ends early."""
    session = plan.session
    driver = SimulatedDriver(plan.robot.require_arm(), session.ready, gripper=0.0)
    simulation = Simulation(plan.program, session, driver, Settings().rate)
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
