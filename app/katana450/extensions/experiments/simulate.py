"""Simulation of a script without server and browser, and its report."""

from __future__ import annotations

import sys
from argparse import Namespace
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from functools import partial
from pathlib import Path

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.messages import part
from katana450.arm.control.state.state import State
from katana450.arm.robot.props import load_props
from katana450.cli.version import version
from katana450.extensions.importers.formats.scene_file import load_initial_scene
from katana450.extensions.media.report import NONE, Report
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.run.compiler import ConditionalJump
from katana450.extensions.programs.run.measured_run import MeasuredRun
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.simulation import (
    Simulation,
    plan_script,
    ready,
    run_by_clock,
)
from katana450.extensions.programs.script.script import Script
from katana450.extensions.programs.script.script_scene import begun
from katana450.extensions.real_arm.plant.axis import PROFILES
from katana450.extensions.real_arm.plant.driver import PlantDriver
from katana450.extras import MissingExtraError
from katana450.settings import Settings

BARE = "The arm is without its gripper: its fingers would reach into the table."
"""Note on a simulation without gripper."""


def simulate(script: Script, options: Namespace) -> int:
    """Plan ``script``, run it unless only planning is requested, and report.

    Returns the exit status. Raises ScriptError and KatanaError.
    """
    scene = options.scene
    if scene is None and script.scene is not None:
        # The file of the script, whose folder has the meshes of its scene.
        scene = options.file
    begin = ready if scene is None else partial(_begin, scene=scene)
    plan = plan_script(script, options.urdf, options.seed, options.speed, begin)
    program, robot = plan.program, plan.robot
    notes = (*((BARE,) if script.bare else ()), *program.notes)
    for note in notes:
        print(note)
    if options.dry_run:
        _print_tasks(program)
        return 0
    plant = None
    if options.plant is not None:
        profile, start = PROFILES[options.plant], plan.start
        plant = PlantDriver(robot, start.q, start.gripper, profile)
    simulation = run_by_clock(plan, plant)
    for choice in _choices(program, simulation):
        print(choice)
        notes = (*notes, choice)
    facts = {
        "version": version(),
        "arm": robot.name,
        "gripper": "none" if script.bare else "fitted",
        "speed": program.speed,
        "ticks_per_s": Settings().rate,
        "seed": options.seed,
    }
    report = Report.of(script, simulation, facts, notes)
    measured = MeasuredRun.of(simulation.arm, simulation.states)
    report = report.with_measured(measured, f"a simulated plant, {options.plant}")
    print(f"{script.name}: {len(simulation.t)} ticks, {simulation.t[-1]:.2f} s.")
    print("\n".join(f"  {line}" for line in report.lines))
    if options.report is not None:
        # Imported here, because only the pictures of a report need the renderer.
        from katana450.extensions.media.report_pictures import stage_pictures

        pictures = NONE
        try:
            pictures = stage_pictures(simulation, robot, load_props())
        except MissingExtraError as error:
            print(f"The report has figures, but no pictures of the arm. {error}")
        report.write(options.report, datetime.now().astimezone(), pictures)
        print(f"Report: {options.report / 'report.html'}")
    return exit_status(report)


def exit_status(report: Report) -> int:
    """Return 1 if a bound of ``report`` is not met, else 0; print these bounds."""
    for bound in report.missed:
        print(f"katana450: a bound is not met: {bound}", file=sys.stderr)
    return 1 if report.missed else 0


def _begin(session: Session, scene: Path) -> State:
    """Return the state of an arm at rest in the scene of a file. Raises InputError."""
    return begun(session, load_initial_scene(session, scene).scene)


def _choices(program: Program, simulation: Simulation) -> Iterator[str]:
    """Yield which alternative the simulation has taken at each ``if``."""
    tasks = {
        task.number: task for task in program.tasks if isinstance(task.action, ConditionalJump)
    }
    for number, held in simulation.run.choices:
        task = tasks[number]
        yield f"Line {task.line}, {task.name}: {'then' if held else 'else'}."


def _print_tasks(program: Program) -> None:
    """Print each task with its line, duration, length and minimum clearance.

    Where alternatives begin and where they meet is printed between them.
    """
    labels = _labels(program)
    times = {task.number: task.end - task.begin for task in program.schedule}
    for number, task in enumerate(program.tasks):
        if number in labels:
            print(f"-- {', '.join(labels[number])}")
        details = ""
        if isinstance(task.action, FollowPlan):
            plan = task.action.plan
            seconds = times.get(number, plan.duration)
            details = f"{seconds:.2f} s, {1e3 * plan.length:.0f} mm"
            if plan.nearest is not None:
                one, other = map(part, plan.nearest.contact.parts)
                apart = 1e3 * plan.nearest.contact.distance
                details += f", {apart:.0f} mm from {one} to {other}"
        print(f"line {task.line:>4}  {task.name:<24} {details}".rstrip())
    if_so = ", if its conditions hold as planned" if program.alternatives else ""
    print(f"{program.steps} steps, about {program.duration:.2f} s{if_so}.")


def _labels(program: Program) -> dict[int, list[str]]:
    """Return what begins at the tasks of a program with alternatives."""
    labels: dict[int, list[str]] = {}
    before = Counter(
        index for number in range(len(program.tasks)) for index in program.next(number)
    )
    for task in program.tasks:
        action = task.action
        if isinstance(action, ConditionalJump):
            for number, alternative in ((action.then, "then"), (action.otherwise, "else")):
                # Where alternatives meet, no alternative begins.
                if before[number] == 1:
                    labels.setdefault(number, []).append(f"{alternative} of line {task.line}")
    joined = {number: ["after the alternatives"] for number, count in before.items() if count > 1}
    return labels | joined
