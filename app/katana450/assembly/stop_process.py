"""The process of STOP: a small server with its own socket, event loop, descriptors and limits.

It is a second path of STOP to the arm, beside the front end. It is restarted when it ends or hangs;
the arm does not stop for that.
"""

from __future__ import annotations

import asyncio
import gc
import logging
import multiprocessing
import signal
import socket
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from katana450.arm.runtime.readiness import writable
from katana450.arm.runtime.stop_link import StopLink
from katana450.assembly.authentication import access_file, address_of, tls_context
from katana450.assembly.log_lines import start_log
from katana450.errors import KatanaError
from katana450.platform_support import name_process, raise_priority
from katana450.server.web.acceptor import Acceptor, raise_descriptor_limit
from katana450.server.web.authenticator import Authenticator
from katana450.server.web.listen import listen_beside
from katana450.server.web.stop_server import StopServer
from katana450.settings import Settings

PULSE_INTERVAL = 0.25
"""[s] Interval at which the process reports that its event loop runs."""

HANG_TIMEOUT = 2.0
"""[s] Silence after which the process has hung."""

START_TIMEOUT = 20.0
"""[s] Timeout for its first report."""

RESTART_INTERVAL = 1.0
"""[s] Minimum time between two starts."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class StopConfig:
    """Configuration of the process of STOP.

    Attributes:
        settings: settings of the server.
        listening: the socket for STOP.
        main_port: the port of the page.
    """

    settings: Settings
    listening: socket.socket
    main_port: int


class StopProcess:
    """The process of STOP, as its parent process sees it."""

    def __init__(self, settings: Settings, main: socket.socket) -> None:
        """Open the port of STOP and start the process.

        ``main``: the socket of the page. Raises ConfigurationError if the port cannot be opened.
        """
        self._listening = listen_beside(main, settings.host, settings.stop_port)
        self.port: int = self._listening.getsockname()[1]
        self._config = StopConfig(settings, self._listening, main.getsockname()[1])
        self._start()

    def _start(self) -> None:
        spawn = multiprocessing.get_context("spawn")
        self._pulses, pulses = spawn.Pipe(duplex=False)
        # The ends are of another class on Windows, with the same methods.
        ends: Any = spawn.Pipe()
        self.pipe: Connection
        self.pipe, child_end = ends
        self._process = spawn.Process(
            target=_run, args=(self._config, child_end, pulses), name="katana450 stop", daemon=True
        )
        self._process.start()
        self._started = self._heard = time.monotonic()
        self._timeout = START_TIMEOUT
        # Closed here, so that each side notices when the other is gone.
        child_end.close()
        pulses.close()

    def watch(self, attach: Callable[[Connection], None]) -> None:
        """Start the process again if it has ended or hung; ``attach`` gets its new pipe."""
        with suppress(EOFError, OSError):
            while self._pulses.poll():
                self._pulses.recv_bytes()
                self._heard, self._timeout = time.monotonic(), HANG_TIMEOUT
        now = time.monotonic()
        if self._process.is_alive():
            if now - self._heard <= self._timeout:
                return
            log.error("The process of STOP has reported nothing for %g s.", self._timeout)
            self._kill()
        if now - self._started < RESTART_INTERVAL:
            return
        log.error(
            "The process of STOP ended with status %s and is started again.",
            self._process.exitcode,
        )
        self._start()
        attach(self.pipe)

    def close(self) -> None:
        """End the process at once, and close the port."""
        self._kill()
        self._listening.close()

    def _kill(self) -> None:
        self._process.kill()
        self._process.join()


def _run(config: StopConfig, pipe: Connection, pulses: Connection) -> None:
    """Run the server of STOP in this process, from start to end."""
    # Ctrl-C reaches all processes of a terminal; the arm's process ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    name_process("katana450 stop")
    raise_priority()
    start_log()
    with suppress(KatanaError):
        # The front end reports the same error.
        asyncio.run(_serve(config, pipe, pulses))


async def _serve(config: StopConfig, pipe: Connection, pulses: Connection) -> None:
    settings, listening = config.settings, config.listening
    address = address_of(settings, listening)
    access = access_file(settings, listening)
    tls = tls_context(settings)
    raise_descriptor_limit()
    ended = asyncio.Event()
    pipes = iter((pipe,))

    def connect() -> Connection:
        for each in pipes:
            return each
        # The arm's process has ended.
        raise EOFError

    link = StopLink(connect, ended.set)
    acceptor = Acceptor(listening)
    authenticator = Authenticator(access, config.main_port, address)
    server = StopServer(link, authenticator, address, config.main_port, acceptor)
    acceptor.start(server.protocol, tls)
    # Exempt all present objects from garbage collection, which would delay STOP.
    gc.collect()
    gc.freeze()
    while not ended.is_set():
        with suppress(OSError):
            if writable(pulses.fileno()):
                pulses.send_bytes(b".")
        with suppress(TimeoutError):
            async with asyncio.timeout(PULSE_INTERVAL):
                await ended.wait()
    acceptor.close()
    await acceptor.wait_closed()
