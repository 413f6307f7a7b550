"""Private connections to the arm's process, which other processes of this server make by a key."""

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

FRONT = "front"
"""Role of the front end. There is one at a time: a new one replaces the one before."""

STOP = "stop"
"""Role of the process of STOP, of which there is one at a time too."""

RECORD = "record"
"""Role of the process that records, of which there is one at a time too."""

BACKLOG = 16
"""Connections that may wait while the arm's process accepts one."""

JOIN_SECONDS = 1.0
"""[s] Timeout for the end of the thread that accepts."""

RETRY_INTERVAL = 0.02
"""[s] Interval of the attempts to connect."""


@dataclass(frozen=True)
class ArmAddress:
    """Address of the arm's process, and the key that every connection must prove to know.

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


def connect(address: ArmAddress, greeting: Greeting) -> Connection:
    """Return a new connection to the arm's process.

    Raises OSError or EOFError while no process listens there.
    """
    try:
        connection: Any = Client(address.name, authkey=address.key)
    except AuthenticationError as error:
        raise ConnectionError("The arm's process refused the key.") from error
    connection.send(greeting)
    connected: Connection = connection
    return connected


def connect_when_ready(
    address: ArmAddress, greeting: Greeting, ended: threading.Event
) -> Connection:
    """Return a new connection as soon as the arm's process listens.

    Raises EOFError when ``ended`` is set first.
    """
    while True:
        with suppress(OSError, EOFError):
            return connect(address, greeting)
        if ended.wait(RETRY_INTERVAL):
            raise EOFError


class ArmListener:
    """Accepts connections in a thread of its own, and hands each to the function of its role."""

    def __init__(self, address: ArmAddress, roles: Roles) -> None:
        """Listen at ``address``. Raises OSError if that is not possible.

        ``roles``: a function for each role. It is called in a thread of the connection.
        """
        # A process that was killed leaves its socket file. On Windows there is no such file.
        with suppress(OSError):
            Path(address.name).unlink()
        self._name = address.name
        self._key = address.key
        self._roles = roles
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
        while True:
            try:
                connection: Any = self._listener.accept()
            except OSError as error:
                if self._closed.wait(RETRY_INTERVAL):
                    return
                log.error("No connection to the arm's process could be accepted: %s.", error)
                continue
            if self._closed.is_set():
                return
            try:
                threading.Thread(
                    target=self._greet, args=(connection,), name="greeting", daemon=True
                ).start()
            except RuntimeError as error:
                log.error("A connection to the arm's process was closed: %s.", error)
                connection.close()

    def _greet(self, connection: Any) -> None:
        with GuardedPipe(connection, "A connection to the arm's process"):
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
