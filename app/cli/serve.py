"""``katana450 serve``: put the parts together and run until told to stop."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from pathlib import Path
from types import FrameType

from app.control.session import Session
from app.drivers.simulated import SimulatedDriver
from app.robot.model import load
from app.runtime.clock import MonotonicClock
from app.runtime.loop import ControlLoop
from app.runtime.mailbox import Mailbox
from app.settings import Settings
from app.view.server import open_server
from app.view.view import View
from robot_description import URDF_PATH


def serve(settings: Settings, urdf: Path = URDF_PATH, tool: str | None = None) -> int:
    """Run the app until SIGINT or SIGTERM; returns the exit status.

    ``urdf``, ``tool``: the arm, and the link its targets are set for; see ``load``.
    """
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s", stream=sys.stderr)
    # The server comes first: a busy port should be told at once.
    server = open_server(settings.host, settings.port)
    model = load(urdf, tool)
    for note in model.notes:
        print(f"katana450: {note}", file=sys.stderr)
    session = Session(model.arm, model.ready(settings.ready))
    driver = SimulatedDriver(model.arm, session.ready, gripper=0.0)
    mailbox = Mailbox(session.check)
    loop = ControlLoop(session, driver, mailbox, MonotonicClock(), settings.rate)
    view = View(server, model, loop, mailbox, settings.frame_rate)
    stopping = threading.Event()

    def stop(_signal: int, _frame: FrameType | None) -> None:
        stopping.set()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, stop)
    loop.start()
    view.start()
    print(f"katana450 is ready: http://{_shown(settings.host)}:{server.get_port()}", flush=True)
    print("Open it in a browser and drag the handle at the gripper. Ctrl-C stops.", flush=True)
    stopping.wait()
    view.stop()
    loop.stop()
    return 0


def _shown(host: str) -> str:
    """The address a person on this machine can open."""
    if host in ("0.0.0.0", "::", ""):
        return "127.0.0.1"
    return f"[{host}]" if ":" in host else host
