"""The front-end process, with gateway and view, that serves people and programs.

It can end and be started again. The arm runs in another process, which stops the arm meanwhile.
"""

from __future__ import annotations

import gc
import socket
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, NamedTuple

from katana450.assembly.supervised import READY, SupervisorPipe
from katana450.extension import ServerFacts
from katana450.platform_support import reset_priority

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


def run_frontend(
    config: ServerFacts, sockets: Sockets, records: Connection, supervisor: SupervisorPipe
) -> None:
    """Run the front end in this process, from start to end. Raises KatanaError.

    records: pipe to the event log.
    """
    reset_priority()

    from katana450.assembly.web_server import WebServer

    web = WebServer(config.settings, sockets.pages)
    web.start()
    supervisor.report(OPEN)
    try:
        _run(config, web, sockets.lines, records, supervisor)
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
    records: Connection,
    supervisor: SupervisorPipe,
) -> None:
    # These imports take a third of a second. The page loads meanwhile.
    from katana450.arm.robot.object_meshes import Meshes
    from katana450.assembly.gateway import Gateway
    from katana450.server.viser_bridge.viser_server import close_server

    meshes = Meshes(config.folder)
    gateway = Gateway(config.settings, web, lines, meshes)
    gateway.hub.supervisor_problem = lambda: supervisor.problem
    gateway.hub.replace_robot = supervisor.replace_robot
    supervisor.notify = gateway.announce
    sender: RecordSender | None = None
    try:
        from katana450.assembly.event_log.record_maker import RecordSender
        from katana450.assembly.frontend import Frontend

        frontend = Frontend(gateway, config, meshes, supervisor.ended)
        gateway.show()
        # Browsers draw the scene meanwhile.
        if config.options.no_log:
            # Without a reader, notes would only take memory.
            web.recorder.enabled = False
        else:
            sender = RecordSender(web.recorder, records)
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
        if sender is not None:
            sender.close()
        close_server(gateway.viser)
