"""Private connections between processes of a server, made by a key: to the arm's, for example."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import AuthenticationError
from multiprocessing.connection import (
    Client,
    Connection,
    Listener,
    answer_challenge,
    deliver_challenge,
)
from pathlib import Path
from typing import Any

from katana450.arm.runtime.pipes.guarded_pipe import GuardedPipe

log = logging.getLogger(__name__)

BACKLOG = 16
"""Connections that may wait while a process accepts one."""

JOIN_SECONDS = 1.0
"""[s] Timeout for the end of the thread that accepts."""

RETRY_INTERVAL = 0.02
"""[s] Interval of the attempts to connect."""


@dataclass(frozen=True)
class PrivateAddress:
    """Address of a process, and the key that every connection must prove to know.

    Attributes:
        name: a socket file in a private folder, or the name of a pipe of Windows.
        key: the key.
    """

    name: str
    key: bytes = field(repr=False)


@dataclass(frozen=True)
class Greeting:
    """First message on a connection.

    Attributes:
        role: the role of the connection.
        number: number of the newest command; the commands up to it are void.
    """

    role: str
    number: int = 0


Roles = dict[str, Callable[[Connection, Greeting], None]]


def connect(
    address: PrivateAddress, greeting: Greeting, timeout: float | None = None
) -> Connection:
    """Return a new connection to the process that listens at ``address``.

    ``timeout``: maximum time until that process answers [s], since one that hangs accepts
    connections too; None waits. Raises OSError or EOFError while no process listens there.
    """
    connection: Any = Client(address.name)
    try:
        if not connection.poll(timeout):
            raise EOFError(f"No process answers at {address.name}.")
        answer_challenge(connection, address.key)
        deliver_challenge(connection, address.key)
        connection.send(greeting)
    except AuthenticationError as error:
        connection.close()
        raise ConnectionError(f"The process at {address.name} refused the key.") from error
    except BaseException:
        connection.close()
        raise
    connected: Connection = connection
    return connected


def connect_when_ready(
    address: PrivateAddress, greeting: Greeting, ended: threading.Event
) -> Connection:
    """Return a new connection as soon as the process of ``address`` listens.

    Raises EOFError when ``ended`` is set first.
    """
    while True:
        with suppress(OSError, EOFError):
            return connect(address, greeting)
        if ended.wait(RETRY_INTERVAL):
            raise EOFError


class PrivateListener:
    """Accepts connections in a thread of its own, and hands each to the function of its role."""

    def __init__(self, address: PrivateAddress, roles: Roles, title: str) -> None:
        """Listen at ``address``. Raises OSError if that is not possible.

        Args:
            address: the address of this process.
            roles: a function for each role. It is called in a thread of the connection.
            title: name of this process for people, within a sentence.
        """
        # A process that was killed leaves its socket file. On Windows there is no such file.
        with suppress(OSError):
            Path(address.name).unlink()
        self._name, self._key = address.name, address.key
        self._roles, self._title = roles, title
        # Without a key: a client that stalls in its handshake must not keep others out.
        self._listener = Listener(address.name, backlog=BACKLOG)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._accept, name="listener", daemon=True)

    def start(self) -> None:
        """Start to accept connections."""
        self._thread.start()

    def close(self) -> None:
        """Stop listening, and remove the socket file; open connections stay open."""
        self._closed.set()
        # Wakes the thread, which otherwise waits in its call.
        with suppress(OSError, EOFError):
            Client(self._name).close()
        self._thread.join(JOIN_SECONDS)
        with suppress(OSError):
            self._listener.close()

    def _accept(self) -> None:
        reported = ""
        while True:
            try:
                connection: Any = self._listener.accept()
            except OSError as error:
                if self._closed.wait(RETRY_INTERVAL):
                    return
                # As when too many files are open: later connections may be accepted.
                if reported != (reported := str(error)):
                    log.error("No connection to %s could be accepted: %s.", self._title, error)
                continue
            if self._closed.is_set():
                return
            try:
                threading.Thread(
                    target=self._greet, args=(connection,), name="greeting", daemon=True
                ).start()
            except RuntimeError as error:
                log.error("A connection to %s was closed: %s.", self._title, error)
                connection.close()

    def _greet(self, connection: Any) -> None:
        with GuardedPipe(connection, f"A connection to {self._title}"):
            try:
                deliver_challenge(connection, self._key)
                answer_challenge(connection, self._key)
                greeting = connection.recv()
            except AuthenticationError:
                connection.close()
                return
            attach = self._roles.get(greeting.role)
            if attach is None:
                connection.close()
            else:
                attach(connection, greeting)
