"""Execution of a script on a server from a program, without output."""

from __future__ import annotations

import time
from argparse import Namespace

from katana450.client import Client, RefusedError
from katana450.client.files import LostError
from katana450.extensions.experiments.live import (
    END_STATUSES,
    STATE_RATE,
    UNPLANNED_STATUSES,
    send_script,
)
from katana450.extensions.programs.requests import ProgramOrder, Steer
from katana450.server.api import answers


def run_script(client: Client, text: str, speed: float) -> answers.State:
    """Plan and run the script ``text`` on the server of ``client``; return its state at the end.

    ``speed``: fraction of the script's own speed. Raises RefusedError with the reason if it cannot
    be planned, or ends early.
    """
    send_script(client, text, Namespace(scene=None, speed=speed))
    while _progress(client).status == "planning":
        time.sleep(1.0 / STATE_RATE)
    if (planned := _progress(client)).status in UNPLANNED_STATUSES:
        raise RefusedError(planned.why)
    client.ask(Steer(order=ProgramOrder.RUN))
    for state in client.states(STATE_RATE):
        now = state.program
        if now is None:
            break
        if now.status in END_STATUSES:
            if now.status != "done":
                raise RefusedError(now.why)
            return state
    raise LostError("The server no longer knows the program.")


def _progress(client: Client) -> answers.Progress:
    program = client.query(answers.State).program
    if program is None:
        raise LostError("The server no longer knows the program.")
    return program
