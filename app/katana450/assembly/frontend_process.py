"""The front-end process, with gateway and view, that serves people and programs.

It can end and be started again. The arm runs in another process, which stops the arm meanwhile.
"""

from __future__ import annotations

import gc
import socket
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

from katana450.assembly.supervised import SupervisorPipe
from katana450.extension import ServerFacts
from katana450.platform_support import reset_priority, state_folder

OPEN = "open"
"""Status of the process: our page can be loaded. It is ready when the arm is connected too."""


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
        # These imports take a third of a second. The page loads meanwhile.
        from katana450.assembly.frontend import serve

        serve(config, web, sockets.lines, log_folder(config.options, config.port), supervisor)
    except EOFError:
        # The server ends before this process is ready.
        return
    finally:
        web.stop()
        sockets.pages.close()
        # Let Python collect reference cycles when it ends.
        gc.unfreeze()
