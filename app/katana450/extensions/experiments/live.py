"""A script run on a server, with its progress in the terminal; one is started where none is."""

from __future__ import annotations

import subprocess
import sys
import time
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from urllib.parse import urlsplit

from katana450.client import Client, RefusedError, connect
from katana450.client.files import LostError
from katana450.errors import ConfigurationError, KatanaError
from katana450.extensions.programs.requests import Program, ProgramOrder, Steer
from katana450.extensions.programs.script import Script
from katana450.platform_support import without_interrupts
from katana450.server.api import answers

NAME = "Terminal"
"""As which others see who started the program."""

PART = 150
"""Characters of a script sent at once: a request stays small whatever they are."""

HZ = 10.0
"""States a second that are asked for."""

STARTED = 60.0
"""[s] By then a server of ours is there."""

ENDED = ("done", "stopped", "failed", "refused", "cancelled")


def run_live(text: str, script: Script, options: Namespace) -> int:
    """Run ``text`` on the server at ``options.url``; returns the exit status."""
    with _server(script, options) as url, connect(url, NAME, options.token) as arm:
        try:
            _send(arm, text, options.speed)
            arm.ask(Steer(order=ProgramOrder.RUN))
            return _follow(arm)
        except KeyboardInterrupt:
            # Before all of the script is sent there is nothing to end.
            with suppress(RefusedError):
                arm.ask(Steer(order=ProgramOrder.END))
            print("\nkatana450: the program is ended; the arm holds.", file=sys.stderr)
            return 130


def _send(arm: Client, text: str, speed: float) -> None:
    """Have it planned. Raises KatanaError with what is wrong with it."""
    parts = [text[at : at + PART] for at in range(0, len(text), PART)] or [""]
    for part in parts[:-1]:
        arm.ask(Program(text=part, more=True))
    arm.ask(Program(text=parts[-1], speed=speed))
    while (now := arm.query(answers.State).program) is not None and now.status == "planning":
        if now.steps and sys.stderr.isatty():
            line = f"{now.task}, step {now.step} of {now.steps}, {now.fraction:4.0%}"
            print(f"\r{line:<70}", end="", file=sys.stderr, flush=True)
        time.sleep(1.0 / HZ)
    if now is None or now.status != "ready":
        raise KatanaError(now.why if now is not None else "The server has forgotten the script.")
    print(f"{now.name}: {now.steps} steps, {now.seconds:.1f} s of motion at full speed.")


def _follow(arm: Client) -> int:
    """Tell how it goes, until it has ended."""
    shown = ""
    terminal = sys.stderr.isatty()
    for state in arm.states(HZ):
        now = state.program
        if now is None:
            raise LostError("The server has forgotten the program.")
        line = f"step {now.step} of {now.steps}, line {now.line}: {now.task} {now.fraction:4.0%}"
        if now.status != "running":
            line += f" ({now.status})"
        if terminal:
            print(f"\r{line:<70}", end="", file=sys.stderr, flush=True)
        elif f"{now.step} {now.task}" != shown:
            shown = f"{now.step} {now.task}"
            print(line, flush=True)
        if now.status in ENDED:
            if terminal:
                print(file=sys.stderr)
            if now.status == "done":
                print("Done.")
                return 0
            raise KatanaError(now.why)
    raise LostError("The server has hung up.")


@contextmanager
def _server(script: Script, options: Namespace) -> Iterator[str]:
    """The address of the server that is there, or of one that lasts as long as this."""
    try:
        with connect(options.url, "Look", options.token):
            pass
    except LostError:
        if not _may_start_at(options.url):
            raise
    else:
        yield options.url
        return
    port = str(urlsplit(options.url).port)
    # -P: Python does not search the current folder, where an `app.py` of the user's may lie.
    python = [sys.executable, "-P", "-m", "katana450"]
    command = [*python, "serve", "--port", port, "--urdf", str(options.urdf)]
    if script.bare:
        command.append("--bare")
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **without_interrupts())
    try:
        _wait_for(server)
        print(f"Open {options.url} in a browser to see it.", flush=True)
        yield options.url
    finally:
        server.terminate()
        server.wait()


def _may_start_at(url: str) -> bool:
    """Return whether a server of ours can be started there: this machine, by number, and plain."""
    parts = urlsplit(url)
    return parts.scheme == "http" and parts.hostname == "127.0.0.1" and parts.port is not None


def _wait_for(server: subprocess.Popen[str]) -> None:
    assert server.stdout is not None
    due = time.monotonic() + STARTED
    for line in server.stdout:
        if "is ready" in line:
            return
        if time.monotonic() > due:
            break
    raise ConfigurationError("The server did not start; see above.")
