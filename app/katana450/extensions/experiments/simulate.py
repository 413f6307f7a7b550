"""Simulation of a script on a simulated clock, without server and browser, and its report."""

from __future__ import annotations

import sys
from argparse import Namespace
from datetime import datetime
from functools import partial
from pathlib import Path

from katana450.arm.control.messages import part
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.props import load_props
from katana450.cli.version import version
from katana450.extensions.importers.initial_scene import initial_scene
from katana450.extensions.media.report import Report
from katana450.extensions.programs.actions import FollowPlan
from katana450.extensions.programs.clocked_run import plan_script, ready, run_by_clock
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.script import Script
from katana450.settings import Settings

BARE = "The arm is without its gripper: its fingers would reach into the table."
"""Note on a simulation without gripper."""


def simulate(script: Script, options: Namespace) -> int:
    """Plan ``script``, run it unless only planning is requested, and report; return the status."""
    begin = ready if options.scene is None else partial(_begin, scene=options.scene)
    plan = plan_script(script, options.urdf, options.seed, options.speed, begin)
    program, robot = plan.program, plan.robot
    notes = (BARE,) if script.bare else ()
    if program.conditions and not options.dry_run:
        lines = ", ".join(str(task.line) for task in program.conditions)
        notes = (*notes, f"Simulated as if each awaited condition held at once: line {lines}.")
    for note in notes:
        print(note)
    if options.dry_run:
        _print_tasks(program)
        return 0
    simulation = run_by_clock(plan)
    facts = {
        "version": version(),
        "arm": robot.name,
        "gripper": "none" if script.bare else "fitted",
        "speed": program.speed,
        "ticks_per_s": Settings().rate,
        "seed": options.seed,
    }
    report = Report.of(script, program, robot.require_arm(), simulation.trace, facts, notes)
    print(f"{script.name}: {len(report.trace.t)} ticks, {report.trace.t[-1]:.2f} s.")
    print("\n".join(f"  {line}" for line in report.lines))
    if options.report is not None:
        # Imported here, because only the pictures of a report need the renderer.
        from katana450.extensions.media.report_pictures import stage_pictures

        pictures = stage_pictures(
            program, robot, plan.session, load_props(), simulation.states, report.trace
        )
        report.write(options.report, datetime.now().astimezone(), pictures)
        print(f"Report: {options.report / 'report.html'}")
    for bound in report.bounds:
        if not bound.held:
            print(f"katana450: a bound is not met: {bound}", file=sys.stderr)
    return 0 if report.held else 1


def _begin(session: Session, scene: Path) -> State:
    """Return the state of an arm at rest in the scene of a file. Raises InputError."""
    found = initial_scene(session, scene, ())
    q = session.ready if found.joints is None else found.joints
    start = session.begin(q, session.require_arm().gripper.clamp(0.0), 0.0)
    return session.step(start, (found.command,), start.t)


def _print_tasks(program: Program) -> None:
    """Print each task with its line, duration, length and minimum clearance."""
    for task in program.tasks:
        details = ""
        if isinstance(task.action, FollowPlan):
            plan = task.action.plan
            details = f"{plan.duration:.2f} s, {1e3 * plan.length:.0f} mm"
            if plan.nearest is not None:
                one, other = map(part, plan.nearest.contact.parts)
                apart = 1e3 * plan.nearest.contact.distance
                details += f", {apart:.0f} mm from {one} to {other}"
        print(f"line {task.line:>4}  {task.name:<24} {details}".rstrip())
    print(f"{program.steps} steps, {program.duration:.2f} s of motion at full speed.")
