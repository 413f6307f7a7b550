"""``katana450 run`` and ``katana450 demo``: run a script on a server, or simulate it and report."""

from __future__ import annotations

import subprocess
import sys
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

from katana450.arm.control.session.session import Session
from katana450.arm.control.state.messages import part
from katana450.arm.control.state.state import State
from katana450.arm.robot.props import load_props
from katana450.cli.version import version
from katana450.client import Client, RefusedError, connect
from katana450.client.client import PROGRESS_RATE, UNPLANNED_STATUSES, is_over
from katana450.client.files import LostError
from katana450.errors import ConfigurationError, InputError, KatanaError
from katana450.extensions.importers.formats.scene_file import load_initial_scene
from katana450.extensions.media.report import NONE, Report
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run.compiler import ConditionalJump
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.simulation import (
    Simulation,
    plan_script,
    ready,
    run_by_clock,
)
from katana450.extensions.programs.script.script import Script, parse
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.extensions.programs.script.script_scene import begun
from katana450.extras import MissingExtraError
from katana450.platform_support import without_interrupts
from katana450.server.api.program_requests import ProgramOrder, Steer
from katana450.settings import Settings


def run(options: Namespace) -> int:
    """Execute ``katana450 run``; return the exit status."""
    try:
        text = script_text(options.file)
        script = parse(text)
        if options.headless or options.dry_run or options.report is not None:
            status = simulate(script, options)
            if status or options.headless or options.dry_run:
                return status
        return run_live(text, script, options)
    except ScriptError as error:
        for problem in error.problems:
            place = f"{options.file}:{problem.line}:{problem.column}"
            print(f"{place}: {problem.text}", file=sys.stderr)
        return 1


def demo(options: Namespace) -> int:
    """Execute ``katana450 demo``; return the exit status."""
    options.file = library_file(options.demo)
    return run(options)


BARE = "The arm is without its gripper: its fingers would reach into the table."
"""Note on a simulation without gripper."""


def simulate(script: Script, options: Namespace) -> int:
    """Plan ``script``, run it unless only planning is requested, and report.

    Returns the exit status. Raises ScriptError and KatanaError.
    """
    scene = _scene_file(script, options)
    begin = ready if scene is None else partial(_begin, scene=scene)
    plan = plan_script(script, options.urdf, options.seed, options.speed, begin)
    program, robot = plan.program, plan.robot
    notes = (*((BARE,) if script.bare else ()), *program.notes)
    for note in notes:
        print(note)
    if options.dry_run:
        _print_tasks(program)
        return 0
    simulation = run_by_clock(plan)
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
    for bound in report.missed:
        print(f"katana450: a bound is not met: {bound}", file=sys.stderr)
    return 1 if report.missed else 0


def _scene_file(script: Script, options: Namespace) -> Path | None:
    """Return the file of the scene, which may be the script; None for the scene of the server."""
    # The folder of a script has the meshes of its scene.
    own = None if script.scene is None else options.file
    return own if options.scene is None else options.scene


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
    """Print each task with its number, line, duration, length and minimum clearance.

    After a condition the numbers of the tasks follow that come next if it holds, and if not.
    """
    times = {task.number: task.end - task.begin for task in program.schedule}
    for number, task in enumerate(program.tasks):
        action, details = task.action, ""
        if isinstance(action, ConditionalJump):
            details = f"then {action.then}, else {action.otherwise}"
        elif isinstance(action, FollowPlan):
            plan = action.plan
            seconds = times.get(number, plan.duration)
            details = f"{seconds:.2f} s, {1e3 * plan.length:.0f} mm"
            if plan.nearest is not None:
                one, other = map(part, plan.nearest.contact.parts)
                apart = 1e3 * plan.nearest.contact.distance
                details += f", {apart:.0f} mm from {one} to {other}"
        if task.after is not None:
            details = f"{details}, then {task.after}".removeprefix(", ")
        print(f"{number:>4}  line {task.line:>4}  {task.name:<24} {details}".rstrip())
    if_so = ", if its conditions hold as planned" if program.alternatives else ""
    print(f"{program.steps} steps, about {program.duration:.2f} s{if_so}.")


NAME = "Terminal"
"""Name of this client, which others see as the owner of the program."""


def run_live(text: str, script: Script, options: Namespace) -> int:
    """Run ``text`` on the server at ``options.url``; return the exit status. Raises KatanaError."""
    if options.scene is not None and script.scene is not None:
        raise InputError(
            "--scene: the script has a scene of its own. Take one of them away, or add --headless "
            "to simulate the script in the other scene."
        )
    with _server_at(script, options) as url, connect(url, NAME, options.token) as arm:
        try:
            arm.send_script(text, options.speed)
            arm.ask(Steer(order=ProgramOrder.RUN))
            _follow(arm)
            return 0
        except KeyboardInterrupt:
            # Refused if the script is not completely sent, because then no program exists.
            with suppress(RefusedError):
                arm.ask(Steer(order=ProgramOrder.END))
            print("\nkatana450: the program has ended; the arm holds.", file=sys.stderr)
            return 130


def _follow(arm: Client) -> None:
    """Print the progress of planning and run until the end. Raises KatanaError if it fails."""
    shown = ""
    has_begun, terminal = False, sys.stderr.isatty()
    for state in arm.states(PROGRESS_RATE):
        now = state.program
        if now is None:
            raise LostError("The server no longer knows the program.")
        if not has_begun and now.status not in ("planning", "ready", *UNPLANNED_STATUSES):
            has_begun = True
            print(f"{now.name}: {now.steps} steps, about {now.seconds:.1f} s. {now.why}")
        line = f"step {now.step} of {now.steps}, line {now.line}: {now.task} {now.fraction:4.0%}"
        if now.status != "running":
            line += f" ({now.status})"
        if terminal:
            print(f"\r{line:<70}", end="", file=sys.stderr, flush=True)
        elif has_begun and f"{now.step} {now.task}" != shown:
            shown = f"{now.step} {now.task}"
            print(line, flush=True)
        if is_over(now):
            if terminal:
                print(file=sys.stderr)
            if now.status != "done":
                raise KatanaError(now.why)
            print("Done.")
            return
    raise LostError("The server closed the connection.")


@contextmanager
def _server_at(script: Script, options: Namespace) -> Iterator[str]:
    """Return the address of the running server, or of one that is started for this block."""
    try:
        with connect(options.url, "Look", options.token):
            pass
    except LostError:
        if not _may_start_at(options.url):
            raise
    else:
        if options.scene is not None:
            raise InputError(
                f"--scene: the server at {options.url} has a scene already. Load the file in its "
                "page, or leave --scene out."
            )
        yield options.url
        return
    port = str(urlsplit(options.url).port)
    # -P: Python does not search the current folder, which may contain an `app.py`.
    python = [sys.executable, "-P", "-m", "katana450"]
    command = [*python, "serve", "--no-browser", "--port", port, "--urdf", str(options.urdf)]
    if script.bare:
        command.append("--bare")
    if (scene := _scene_file(script, options)) is not None:
        command += ["--scene", str(scene)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **without_interrupts())
    try:
        _wait_for(server)
        print(f"Open {options.url} in a browser to watch it.", flush=True)
        yield options.url
    finally:
        server.terminate()
        server.wait()


def _may_start_at(url: str) -> bool:
    """Return whether a server can be started at ``url``: http, on this machine, with a port."""
    parts = urlsplit(url)
    return parts.scheme == "http" and parts.hostname == "127.0.0.1" and parts.port is not None


def _wait_for(server: subprocess.Popen[str]) -> None:
    assert server.stdout is not None
    for line in server.stdout:
        if "is ready" in line:
            return
    raise ConfigurationError("The server did not start. See its messages above.")
