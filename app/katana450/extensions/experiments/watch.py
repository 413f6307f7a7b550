"""``katana450 run --watch``: plan a script again whenever its file is saved; Enter runs it."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from pathlib import Path

from katana450.client import Client, RefusedError, connect
from katana450.client.asynchronous import END_STATUSES
from katana450.errors import InputError, KatanaError
from katana450.extensions.experiments.keyboard import Keyboard
from katana450.extensions.experiments.live import (
    begin,
    planned_program,
    send_script,
    server_at,
)
from katana450.extensions.experiments.problems import print_problems
from katana450.extensions.programs.script import Script, parse
from katana450.extensions.programs.script_files import script_text, text_of
from katana450.extensions.programs.source import ScriptError
from katana450.server.api import answers
from katana450.server.api.program_requests import ProgramOrder, Steer

EVERY = 0.2
"""[s] Interval of the looks at the file and the keyboard."""

HELP = "Save the file to plan it again. Enter runs it, Ctrl-C ends."


def watch(path: Path, script: Script, options: Namespace) -> int:
    """Watch the script at ``path`` until Ctrl-C; return the exit status. Raises KatanaError."""
    with server_at(script, options) as url, connect(url, "Terminal", options.token) as arm:
        keyboard = Keyboard()
        print(HELP, flush=True)
        seen, ready = "", False
        try:
            while True:
                text = _read(path, seen)
                if text != seen and not _runs(arm):
                    seen, ready = text, _plan(arm, path, options)
                if keyboard.line() is not None:
                    _run(arm, options, ready=ready)
                time.sleep(EVERY)
        except KeyboardInterrupt:
            if _runs(arm):
                arm.ask(Steer(order=ProgramOrder.END))
            print("\nkatana450: no longer watching.", file=sys.stderr)
            return 130


def _read(path: Path, seen: str) -> str:
    """Return the text of the script; ``seen`` while an editor replaces its file."""
    try:
        return script_text(path)
    except ScriptError:
        return text_of(path)
    except InputError:
        return seen


def _runs(arm: Client) -> bool:
    """Return whether a program runs or is planned, so that no other can be planned."""
    program = arm.query(answers.State).program
    return program is not None and program.status not in (*END_STATUSES, "ready")


def _plan(arm: Client, path: Path, options: Namespace) -> bool:
    """Plan the script and print the result or its errors; return whether it can run."""
    try:
        text = script_text(path)
        parse(text)
        send_script(arm, text, options)
        planned_program(arm)
    except ScriptError as error:
        print_problems(error, str(path))
    except KatanaError as error:
        print(f"{path}: {error}", file=sys.stderr)
    else:
        return True
    return False


def _run(arm: Client, options: Namespace, *, ready: bool) -> None:
    """Run the program if it is ``ready``; print a refusal."""
    if not ready:
        print("The script has errors. Mend and save it first.", file=sys.stderr)
        return
    try:
        begin(arm, options)
    except RefusedError as error:
        print(f"katana450: {error}", file=sys.stderr)
