"""The front end process, with gateway and view, that serves people and programs.

It can end and be started again. The arm runs in another process, which stops the arm meanwhile.
"""

from __future__ import annotations

import gc
import multiprocessing
import signal
import socket
from argparse import Namespace
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from katana450.assembly.log_lines import start_log
from katana450.errors import ConfigurationError, KatanaError
from katana450.extension import serve_extensions
from katana450.platform_support import name_process, reset_priority
from katana450.settings import Settings

if TYPE_CHECKING:
    from katana450.arm.robot.object_meshes import Mesh

START_SECONDS = 60.0
GOODBYE_SECONDS = 5.0

WAKE_INTERVAL = 0.5
"""[s] Interval at which a failure of the view is checked."""

OPEN, READY = "open", "ready"
"""Status messages of the process: pages can be loaded; the arm is connected."""


@dataclass(frozen=True)
class FrontendConfig:
    """Configuration of a front end, used each time it is started.

    Attributes:
        settings: of the server.
        urdf, tool: see ``robot.loader.load``.
        listening: the socket for browsers.
        lines: the socket for programs that send JSON lines, if any.
        options: options of the extensions; None if no extension takes part.
        meshes: meshes of the initial scene objects.
    """

    settings: Settings
    urdf: Path
    tool: str | None
    listening: socket.socket
    lines: socket.socket | None
    options: Namespace | None
    meshes: tuple[Mesh, ...]


class FrontendProcess:
    """One front end process, as its parent process sees it."""

    def __init__(self, config: FrontendConfig) -> None:
        """Start the process."""
        spawn = multiprocessing.get_context("spawn")
        self._status_receiver, status_sender = spawn.Pipe(duplex=False)
        # The ends are of another class on Windows, with the same methods.
        ends: Any = spawn.Pipe()
        self.pipe: Connection
        self.pipe, child_end = ends
        self._process = spawn.Process(
            target=_run,
            args=(config, child_end, status_sender),
            name="katana450 front",
            daemon=True,
        )
        self._process.start()
        self._statuses: set[str] = set()
        # Closed here, so that each side notices when the other is gone.
        child_end.close()
        status_sender.close()

    @property
    def running(self) -> bool:
        """True while the process runs."""
        return self._process.is_alive()

    @property
    def exit_code(self) -> int | None:
        """Exit status of the process; None while it runs."""
        return self._process.exitcode

    def wait_for(self, word: str) -> None:
        """Wait until the process reports ``word``.

        Raises the error that the process reports, or ConfigurationError if it does not start.
        """
        try:
            if self._status_receiver.poll(START_SECONDS):
                status: Any = self._status_receiver.recv()
                if isinstance(status, KatanaError):
                    raise status
                self._statuses.add(status)
                if status == word:
                    return
        except EOFError:
            pass
        raise ConfigurationError("The page's server did not start; see the log above.")

    def _is_ready(self) -> bool:
        with suppress(EOFError):
            while self._status_receiver.poll():
                self._statuses.add(str(self._status_receiver.recv()))
        return READY in self._statuses

    def kill(self) -> None:
        """Kill the process at once."""
        self._process.kill()

    def stop(self) -> None:
        """Wait until the process ends after the arm has closed the link; kill it after a timeout.

        A process that is not ready yet is terminated at once.
        """
        if not self._is_ready():
            self._process.terminate()
        self._process.join(GOODBYE_SECONDS)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _run(config: FrontendConfig, pipe: Connection, status_sender: Connection) -> None:
    """Run the front end in this process, from start to end."""
    # Ctrl-C reaches all processes of a terminal; the arm's process ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    name_process("katana450 front")
    reset_priority()
    start_log()
    try:
        _serve(config, pipe, status_sender)
    except KatanaError as error:
        status_sender.send(error)
    except (EOFError, BrokenPipeError):
        # The other process ended before this one was ready.
        return


def _serve(config: FrontendConfig, pipe: Connection, status_sender: Connection) -> None:
    from katana450.arm.robot.object_meshes import Meshes
    from katana450.assembly.gateway import Gateway
    from katana450.server.viser_bridge.viser_server import close_server

    meshes = Meshes()
    meshes.put(config.meshes, ())
    options = config.options
    parts = () if options is None else serve_extensions()
    routes = [part.routes for part in parts if part.routes is not None]
    runners = [part.runner() for part in parts if part.runner is not None]
    gateway = Gateway(
        config.settings,
        config.listening,
        config.lines,
        meshes,
        routes,
        partial(runners[0], options=options) if runners and options is not None else None,
    )
    gateway.start()
    status_sender.send(OPEN)
    try:
        # Importing the libraries that read the robot takes most of a second. The page loads
        # meanwhile.
        from katana450.assembly.frontend import build_frontend

        link, view = build_frontend(gateway, config, meshes, pipe)
        view.start()
        # Exempt all present objects from garbage collection, which would delay STOP.
        gc.collect()
        gc.freeze()
        status_sender.send(READY)
        while not link.cut.wait(WAKE_INTERVAL):
            if view.failed.is_set():
                raise SystemExit(1)
        gateway.stop()
        view.stop()
    finally:
        gateway.stop()
        close_server(gateway.viser)
        # Let Python collect reference cycles when it ends.
        gc.unfreeze()
