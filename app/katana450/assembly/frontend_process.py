"""The process that people and programs speak to: gateway and view. It can end and begin again; the
arm is in another, and stops meanwhile.
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
from katana450.platform_support import reset_priority
from katana450.settings import Settings

if TYPE_CHECKING:
    from katana450.arm.robot.object_meshes import Mesh

START_SECONDS = 60.0
GOODBYE_SECONDS = 5.0

WAKE_INTERVAL = 0.5
"""[s] How soon it is noticed that there is no view any more."""

OPEN, READY = "open", "ready"
"""What it says of itself: pages load; the arm is there."""


@dataclass(frozen=True)
class FrontendConfig:
    """What a front is given each time it is started.

    ``urdf``, ``tool``: see ``robot.loader.load``. ``listening``: the port for browsers. ``lines``:
    the one for JSON lines. ``options``: those of the extensions; None where none takes part.
    ``meshes``: those of the objects there are at first.
    """

    settings: Settings
    urdf: Path
    tool: str | None
    listening: socket.socket
    lines: socket.socket | None
    options: Namespace | None
    meshes: tuple[Mesh, ...]


class Front:
    """One such process, as the one that started it sees it."""

    def __init__(self, config: FrontendConfig) -> None:
        """Starts it."""
        spawn = multiprocessing.get_context("spawn")
        self._told, telling = spawn.Pipe(duplex=False)
        # The ends are of another class on Windows, with the same methods.
        ends: Any = spawn.Pipe()
        self.pipe: Connection
        self.pipe, theirs = ends
        self._process = spawn.Process(
            target=_run,
            args=(config, theirs, telling),
            name="katana450 front",
            daemon=True,
        )
        self._process.start()
        self._said: set[str] = set()
        # Theirs alone, so that each side hears when the other is gone.
        theirs.close()
        telling.close()

    @property
    def running(self) -> bool:
        return self._process.is_alive()

    @property
    def exit_code(self) -> int | None:
        return self._process.exitcode

    def wait_for(self, word: str) -> None:
        """Return once it says ``word``. Raises what kept it from that, or ConfigurationError."""
        try:
            if self._told.poll(START_SECONDS):
                said: Any = self._told.recv()
                if isinstance(said, KatanaError):
                    raise said
                self._said.add(said)
                if said == word:
                    return
        except EOFError:
            pass
        raise ConfigurationError("The page's server did not start; see the log above.")

    def _is_ready(self) -> bool:
        with suppress(EOFError):
            while self._told.poll():
                self._said.add(str(self._told.recv()))
        return READY in self._said

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()

    def stop(self) -> None:
        """End it: once the arm has hung up in peace, before that or after a while by force."""
        if not self._is_ready():
            self._process.terminate()
        self._process.join(GOODBYE_SECONDS)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _run(config: FrontendConfig, pipe: Connection, telling: Connection) -> None:
    """What it does, from its start to its end."""
    # Ctrl-C goes to all processes of a terminal; the arm's says when this one is to end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    reset_priority()
    start_log()
    try:
        _serve(config, pipe, telling)
    except KatanaError as error:
        telling.send(error)
    except (EOFError, BrokenPipeError):
        # The other process is gone before this one was there.
        return


def _serve(config: FrontendConfig, pipe: Connection, telling: Connection) -> None:
    from katana450.arm.robot.object_meshes import Meshes
    from katana450.assembly.gateway import Gateway
    from katana450.server.viser_bridge.viser_server import close_server

    kept = Meshes()
    kept.put(config.meshes, ())
    options = config.options
    taking_part = () if options is None else serve_extensions()
    routes = [part.routes for part in taking_part if part.routes is not None]
    runners = [part.runner() for part in taking_part if part.runner is not None]
    gateway = Gateway(
        config.settings,
        config.listening,
        config.lines,
        kept,
        routes,
        partial(runners[0], options=options) if runners and options is not None else None,
    )
    gateway.start()
    telling.send(OPEN)
    try:
        # The libraries that read the robot take most of a second: the page loads in the meantime.
        from katana450.assembly.frontend import build_frontend

        link, view = build_frontend(gateway, config, kept, pipe)
        view.start()
        # What is there by now stays: looking through it for garbage would keep STOP waiting.
        gc.collect()
        gc.freeze()
        telling.send(READY)
        while not link.cut.wait(WAKE_INTERVAL):
            if view.failed.is_set():
                raise SystemExit(1)
        gateway.stop()
        view.stop()
    finally:
        gateway.stop()
        close_server(gateway.viser)
        # So that Python, as it ends, puts away what hangs together in circles.
        gc.unfreeze()
