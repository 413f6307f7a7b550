"""Acceptor of connections in small batches, which closes idle and surplus connections.

A connection is *waiting* until a known client sends a request on it, and again once that is
answered. The number of waiting connections is bounded. One more replaces the oldest waiting
connection of the address that has the most of them. So no address can keep others out, not even
that of a reverse proxy, from which all connections come.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import ssl
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

log = logging.getLogger(__name__)

MAX_WAITING = 64
"""Maximum number of waiting connections of all clients together."""

WAITING_TIMEOUT = 10.0
"""Timeout [s] after which a waiting connection is closed: without a request, with half a request or
half a TLS handshake, or idle after an answer."""

SEND_TIMEOUT = 120.0
"""Timeout [s] for sending an answer to a slow reader."""

ACCEPT_BATCH = 8
"""Connections accepted in one turn of the event loop: STOP waits for at most this many."""

CHECK_EVERY = 0.5
"""Interval of the timeout checks [s]."""

BACK_OFF = 0.2
"""Pause [s] in accepting after the system had no room for another connection."""

LOG_EVERY = 10.0
"""Minimum interval [s] of log lines about the same problem."""

NO_DESCRIPTOR_ERRORS = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


@dataclass(eq=False)
class _Connection:
    """An open connection. ``since``: time at which it began to wait or was found closing [s]."""

    sock: socket.socket
    client: tuple[str, int]
    since: float
    opening: asyncio.Task[None] | None = None
    transport: asyncio.Transport | None = None
    closing: bool = False

    @property
    def open(self) -> bool:
        """True while the socket is open."""
        return self.sock.fileno() >= 0

    def close(self) -> None:
        """Close the connection at once; unsent data is lost."""
        if self.transport is not None:
            self.transport.abort()
        elif self.opening is not None:
            self.opening.cancel()


class Acceptor:
    """Accepts the connections of one listening socket and passes each to a protocol."""

    def __init__(self, listening: socket.socket, waiting: int = MAX_WAITING) -> None:
        """Prepare to accept from ``listening``. ``waiting``: maximum of waiting connections."""
        self._listening = listening
        self._maximum = waiting
        self._waiting: dict[tuple[str, int], _Connection] = {}
        self._busy: dict[tuple[str, int], _Connection] = {}
        self._tasks: list[asyncio.Task[None]] = []
        self._logged: dict[str, float] = {}

    def start(
        self, protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None = None
    ) -> Acceptor:
        """Start to accept connections in the running event loop."""
        self._listening.setblocking(False)
        work = (self._accept(protocol, tls), self._watch())
        self._tasks = [asyncio.create_task(each) for each in work]
        return self

    def close(self) -> None:
        """Stop accepting; open connections stay open."""
        for task in self._tasks:
            task.cancel()

    async def wait_closed(self) -> None:
        """Wait until accepting has ended, then close the waiting connections."""
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for connection in tuple(self._waiting.values()):
            connection.close()

    @contextmanager
    def kept(self, client: tuple[str, int] | None) -> Iterator[None]:
        """Exempt the connection of ``client`` from closing inside the ``with`` block."""
        connection = None if client is None else self._waiting.pop(client, None)
        if connection is None:
            yield
            return
        self._busy[connection.client] = connection
        try:
            yield
        finally:
            if self._busy.get(connection.client) is connection:
                del self._busy[connection.client]
            if connection.open:
                self._wait(connection)

    async def _accept(
        self, protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None
    ) -> None:
        loop = asyncio.get_running_loop()
        while True:
            for _ in range(ACCEPT_BATCH):
                try:
                    sock, address = await loop.sock_accept(self._listening)
                except OSError as error:
                    self._report(f"A connection could not be accepted: {error.strerror}.")
                    # A client that disconnected in the queue leaves room for the next.
                    if error.errno in NO_DESCRIPTOR_ERRORS:
                        self._make_room(self._maximum // 2)
                        await asyncio.sleep(BACK_OFF)
                    break
                connection = _Connection(sock, (address[0], address[1]), loop.time())
                connection.opening = asyncio.create_task(self._open(connection, protocol, tls))
                self._wait(connection)
                if len(self._waiting) > self._maximum:
                    self._make_room(self._maximum)
            # An accept that returns at once does not yield to other tasks.
            await asyncio.sleep(0)

    async def _open(
        self,
        connection: _Connection,
        protocol: Callable[[], asyncio.Protocol],
        tls: ssl.SSLContext | None,
    ) -> None:
        loop = asyncio.get_running_loop()
        timeout = None if tls is None else WAITING_TIMEOUT
        with suppress(OSError):
            connection.transport, _ = await loop.connect_accepted_socket(
                protocol, connection.sock, ssl=tls, ssl_handshake_timeout=timeout
            )

    def _wait(self, connection: _Connection) -> None:
        connection.since = asyncio.get_running_loop().time()
        # The newest comes last, even where the client uses a port again.
        self._waiting.pop(connection.client, None)
        self._waiting[connection.client] = connection

    def _forget(self, connection: _Connection) -> None:
        if self._waiting.get(connection.client) is connection:
            del self._waiting[connection.client]

    def _make_room(self, maximum: int) -> None:
        """Close the oldest connection of the commonest address if more than ``maximum`` wait."""
        for connection in tuple(self._waiting.values()):
            if not connection.open:
                self._forget(connection)
        if len(self._waiting) <= maximum:
            return
        peers = Counter(address for address, _ in self._waiting)
        crowded, _ = peers.most_common(1)[0]
        oldest = next(each for each in self._waiting.values() if each.client[0] == crowded)
        self._report(f"Too many connections wait; closed the oldest of {crowded}.")
        self._forget(oldest)
        oldest.close()

    async def _watch(self) -> None:
        loop = asyncio.get_running_loop()
        t = loop.time()
        while True:
            await asyncio.sleep(CHECK_EVERY)
            before, t = t, loop.time()
            # Data that arrived while the loop itself was delayed is not read yet.
            held_up = max(t - before - 2.0 * CHECK_EVERY, 0.0)
            for connection in tuple(self._waiting.values()):
                connection.since += held_up
                transport = connection.transport
                unsent = transport is not None and transport.get_write_buffer_size() > 0
                if not connection.open:
                    self._forget(connection)
                elif t - connection.since > (SEND_TIMEOUT if unsent else WAITING_TIMEOUT):
                    self._forget(connection)
                    connection.close()
            for connection in tuple(self._busy.values()):
                # If the peer reads nothing, closing never ends by itself.
                if connection.transport is not None and connection.transport.is_closing():
                    if not connection.closing:
                        connection.closing, connection.since = True, t
                    elif t - connection.since > WAITING_TIMEOUT:
                        connection.close()

    def _report(self, problem: str) -> None:
        """Log ``problem``, but not more often than every ``LOG_EVERY``."""
        t = asyncio.get_running_loop().time()
        if t - self._logged.get(problem, -LOG_EVERY) >= LOG_EVERY:
            self._logged = {key: at for key, at in self._logged.items() if t - at < LOG_EVERY}
            self._logged[problem] = t
            log.warning("%s", problem)
