"""A script run without server and browser, on a clock of its own, and what is told of it."""

from __future__ import annotations

import sys
from argparse import Namespace
from dataclasses import replace
from datetime import datetime

from app.cli.assembly import described
from app.cli.progress import progress
from app.cli.version import version
from app.drivers.simulated import SimulatedDriver
from app.errors import KatanaError
from app.programs.bench import Rig
from app.programs.order import Go
from app.programs.program import Program, compiled
from app.programs.runner import Phase
from app.programs.script import Script
from app.report.report import Report
from app.report.trace import Rehearsal
from app.settings import Settings

BARE = "The arm is without its gripper: its fingers would reach into the table."


def rehearse(script: Script, options: Namespace) -> int:
    """Plan it, and unless that is all run it on a clock of its own and report."""
    settings = Settings()
    model, session, _ = described(replace(settings, bare=script.bare), options.urdf, None)
    rig = Rig(session, model.T_base_shoulder, options.seed)
    program = compiled(script, rig, session.begin(session.ready, 0.0, 0.0), options.speed)
    notes = (BARE,) if script.bare else ()
    for note in notes:
        print(note)
    if options.dry_run:
        _tell(program)
        return 0
    driver = SimulatedDriver(model.arm, session.ready, gripper=0.0)
    rehearsal = Rehearsal(program, session, driver, settings.rate)
    done, total = 0, 1000
    ticks = progress(range(total), total, script.name)
    for share in rehearsal.ticks():
        while done < int(share * total):
            done += 1
            next(ticks, None)
    for _ in ticks:
        pass
    if rehearsal.run.phase is not Phase.DONE:
        raise KatanaError(rehearsal.run.why)
    facts = {
        "version": version(),
        "arm": model.name,
        "gripper": "none" if script.bare else "fitted",
        "speed": program.speed,
        "ticks_per_s": settings.rate,
        "seed": options.seed,
    }
    report = Report.of(script, program, model.arm, rehearsal.trace, facts, notes)
    print(f"{script.name}: {len(report.trace.t)} ticks, {report.trace.t[-1]:.2f} s.")
    print("\n".join(f"  {line}" for line in report.lines))
    if options.report is not None:
        report.write(options.report, datetime.now().astimezone())
        print(f"Report: {options.report / 'report.html'}")
    for bound in report.bounds:
        if not bound.held:
            print(f"katana450: a bound is missed: {bound}", file=sys.stderr)
    return 0 if report.held else 1


def _tell(program: Program) -> None:
    """Each task with its line, its time and the nearest it comes to anything."""
    for task in program.tasks:
        said = ""
        if isinstance(task.order, Go):
            plan = task.order.plan
            said = f"{plan.duration:.2f} s, {1e3 * plan.length:.0f} mm"
            if plan.nearest is not None:
                one, other = plan.nearest.contact.parts
                apart = 1e3 * plan.nearest.contact.distance
                said += f", {apart:.0f} mm from {one} to {other}"
        print(f"line {task.line:>4}  {task.name:<24} {said}".rstrip())
    print(f"{program.steps} steps, {program.duration:.2f} s of motion at full speed.")
