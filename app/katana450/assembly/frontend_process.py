"""The front-end process, with gateway and view, that serves people and programs.

It can end and be started again. The arm runs in another process, which stops the arm meanwhile.
"""

from __future__ import annotations

import gc
import socket
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from katana450.assembly.supervised import READY, SupervisorPipe
from katana450.extension import ServerFacts
from katana450.platform_support import reset_priority, state_folder

if TYPE_CHECKING:
    from katana450.assembly.web_server import WebServer

OPEN = "open"
"""Status of the process: our page can be loaded. It is ready when the arm is connected too."""

WAKE_INTERVAL = 0.25
"""[s] Interval at which a failure of the view is checked."""

HANG_SECONDS = 5.0
"""[s] Time after which an event loop that does not turn counts as hung."""


class Sockets(NamedTuple):
    """The sockets for browsers, and for programs that send JSON lines, if any."""

    pages: socket.socket
    lines: socket.socket | None


def log_folder(options: Namespace, port: int) -> Path | None:
    """Return the folder of the event log of the server on ``port``; None without a log."""
    if options.no_log:
        return None
    return options.log or state_folder() / "katana450" / "events" / f"port-{port}"


def run_frontend(config: ServerFacts, sockets: Sockets, supervisor: SupervisorPipe) -> None:
    """Run the front end in this process, from start to end. Raises KatanaError."""
    reset_priority()

    from katana450.assembly.web_server import WebServer

    web = WebServer(config.settings, sockets.pages)
    web.start()
    supervisor.report(OPEN)
    try:
        _run(config, web, sockets.lines, supervisor)
    except EOFError:
        # The server ends before this process is ready.
        return
    finally:
        web.stop()
        sockets.pages.close()
        # Let Python collect reference cycles when it ends.
        gc.unfreeze()


def _run(
    config: ServerFacts,
    web: WebServer,
    lines: socket.socket | None,
    supervisor: SupervisorPipe,
) -> None:
    # These imports take a third of a second. The page loads meanwhile.
    from katana450.arm.control.lease import SERVER
    from katana450.arm.robot.object_meshes import Meshes
    from katana450.assembly.gateway import Gateway
    from katana450.server.viser_bridge.viser_server import close_server

    meshes = Meshes(config.folder)
    gateway = Gateway(config.settings, web, lines, meshes)
    gateway.hub.replace_robot = supervisor.replace_robot
    recorder, folder = web.recorder, log_folder(config.options, config.port)
    # Without a reader, notes would only take memory.
    recorder.enabled = folder is not None
    event_log: DiskLog | None = None

    def notify(why: str) -> None:
        recorder.note("restart", SERVER, why=why)
        gateway.announce(why)

    supervisor.notify = notify
    try:
        from katana450.assembly.event_log.disk_log import DiskLog
        from katana450.assembly.frontend import Frontend

        frontend = Frontend(gateway, config, meshes, supervisor.ended)
        gateway.show()
        # Browsers draw the scene meanwhile.
        if folder is not None:
            event_log = DiskLog(recorder, folder, config.port)
        gateway.start(config.options)
        supervisor.prove(lambda: gateway.hub.held_up < HANG_SECONDS)
        frontend.start()
        supervisor.report(READY)
        while not supervisor.ended.wait(WAKE_INTERVAL) and not frontend.pipe.cut.is_set():
            if frontend.view.failed.is_set():
                raise SystemExit(1)
        frontend.pipe.close()
        web.stop()
        frontend.stop()
    finally:
        web.stop()
        if event_log is not None:
            event_log.close()
        close_server(gateway.viser)
