"""Execution of a script on a server, with progress in the terminal; starts a server if needed."""

from __future__ import annotations

import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

from katana450.client import Client, RefusedError, connect
from katana450.client.client import PROGRESS_RATE, UNPLANNED_STATUSES, is_over
from katana450.client.files import LostError
from katana450.errors import ConfigurationError, InputError, KatanaError
from katana450.extensions.programs.language.attached_files import without_scene
from katana450.extensions.programs.script.script import Script
from katana450.platform_support import without_interrupts
from katana450.server.api import answers
from katana450.server.api.program_requests import ProgramOrder, Steer

NAME = "Terminal"
"""Name of this client, which others see as the owner of the program."""


def run_live(text: str, script: Script, options: Namespace) -> int:
    """Run ``text`` on the server at ``options.url``; return the exit status. Raises KatanaError."""
    with _server_at(script, options) as url, connect(url, NAME, options.token) as arm:
        try:
            # ``options.scene`` replaces the scene of the script.
            arm.send_script(text if options.scene is None else without_scene(text), options.speed)
            _planned_program(arm)
            arm.ask(Steer(order=ProgramOrder.RUN, unattended=options.unattended))
            _follow(arm)
            return 0
        except KeyboardInterrupt:
            if options.unattended and _runs(arm):
                print(
                    "\nkatana450: the program runs on, unattended. STOP ends it.", file=sys.stderr
                )
                return 0
            # Refused if the script is not completely sent, because then no program exists.
            with suppress(RefusedError):
                arm.ask(Steer(order=ProgramOrder.END))
            print("\nkatana450: the program has ended; the arm holds.", file=sys.stderr)
            return 130


def _runs(arm: Client) -> bool:
    """Return whether the program has begun and runs unattended."""
    program = arm.query(answers.State).program
    return program is not None and program.unattended


def _planned_program(arm: Client) -> None:
    """Wait until the script is planned. Raises KatanaError with its errors."""
    while (now := arm.query(answers.State).program) is not None and now.status == "planning":
        if now.steps and sys.stderr.isatty():
            _show(f"{now.task}, step {now.step} of {now.steps}, {now.fraction:4.0%}")
        time.sleep(1.0 / PROGRESS_RATE)
    # A program that runs at once may have ended already.
    if now is None or now.status in UNPLANNED_STATUSES:
        raise KatanaError(now.why if now is not None else "The server no longer knows the script.")
    print(f"{now.name}: {now.steps} steps, about {now.seconds:.1f} s. {now.why}")


def _follow(arm: Client) -> None:
    """Print the progress of the program until it ends. Raises KatanaError if it fails."""
    shown = ""
    terminal = sys.stderr.isatty()
    for state in arm.states(PROGRESS_RATE):
        now = state.program
        if now is None:
            raise LostError("The server no longer knows the program.")
        line = f"step {now.step} of {now.steps}, line {now.line}: {now.task} {now.fraction:4.0%}"
        if now.status != "running":
            line += f" ({now.status})"
        if terminal:
            _show(line)
        elif f"{now.step} {now.task}" != shown:
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


def _show(line: str) -> None:
    """Show ``line`` in place of the last one of the terminal."""
    print(f"\r{line:<70}", end="", file=sys.stderr, flush=True)


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
        if options.plant is not None and options.report is None:
            raise InputError(
                f"--plant: the server at {options.url} has an arm already. Leave --plant out, or "
                "add --headless or --report to simulate a plant here."
            )
        yield options.url
        return
    port = str(urlsplit(options.url).port)
    # -P: Python does not search the current folder, which may contain an `app.py`.
    python = [sys.executable, "-P", "-m", "katana450"]
    command = [*python, "serve", "--no-browser", "--port", port, "--urdf", str(options.urdf)]
    if script.bare:
        command.append("--bare")
    if options.plant is not None:
        command += ["--plant", options.plant]
    scene = options.scene
    if scene is None and script.scene is not None:
        # The file of the script, whose folder has the meshes of its scene.
        scene = options.file
    if scene is not None:
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
