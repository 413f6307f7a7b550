"""Accepts connections, few at a time, and closes those that say nothing or are too many.

A connection is *waiting* until somebody known asks for something on it, and again once that is
answered. Only so many may wait: one more takes the place of the one that has waited longest among
those of the address that has most. So no address can keep others out, not even a reverse proxy's,
from which everybody comes.
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

from katana450.platform_support import raise_open_file_limit

log = logging.getLogger(__name__)

MAX_WAITING = 64
"""Connections that may wait at a time, of everybody together."""

WAITING_TIMEOUT = 10.0
"""[s] After which a waiting connection is closed: nothing said, half a request, half a handshake
of TLS, or nothing more."""

SEND_TIMEOUT = 120.0
"""[s] In which an answer has left for a slow reader, or is given up."""

ACCEPT_BATCH = 8
"""Connections accepted in one turn of the event loop: STOP waits for this many at most."""

CHECK_EVERY = 0.5
"""[s] Between two looks at who has waited too long."""

BACK_OFF = 0.2
"""[s] Without accepting, after the system had no room for another connection."""

LOG_EVERY = 10.0
"""[s] Between two lines in the log about the same trouble."""

DESCRIPTORS = 1024
"""Files and sockets that may have to be open at once: two or three for each of the connections that
are allowed, and a reserve for libraries, files and pipes."""

WANTED_DESCRIPTORS = 4096

NO_DESCRIPTOR_ERRORS = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


def raise_descriptor_limit() -> None:
    """Let this process open WANTED_DESCRIPTORS files, or as many as the system allows."""
    limit = raise_open_file_limit(WANTED_DESCRIPTORS)
    if limit is not None and limit < DESCRIPTORS:
        log.warning(
            "Only %d files can be open at once: a crowd can use them up, and STOP from a new "
            "connection fails then. Raise the limit to %d (`ulimit -n`).",
            limit,
            DESCRIPTORS,
        )


@dataclass(eq=False)
class _Connection:
    """One that is open. since: when it began to wait, or was found to be closing [s]."""

    sock: socket.socket
    client: tuple[str, int]
    since: float
    opening: asyncio.Task[None] | None = None
    transport: asyncio.Transport | None = None
    closing: bool = False

    @property
    def open(self) -> bool:
        return self.sock.fileno() >= 0

    def close(self) -> None:
        """Close it at once; what was not sent is lost."""
        if self.transport is not None:
            self.transport.abort()
        elif self.opening is not None:
            self.opening.cancel()


class Acceptor:
    """Accepts the connections of one listening socket and hands each to a protocol."""

    def __init__(self, listening: socket.socket, waiting: int = MAX_WAITING) -> None:
        """``waiting``: connections that may wait at a time."""
        self._listening = listening
        self._maximum = waiting
        self._waiting: dict[tuple[str, int], _Connection] = {}
        self._busy: dict[tuple[str, int], _Connection] = {}
        self._tasks: list[asyncio.Task[None]] = []
        self._logged: dict[str, float] = {}

    def start(
        self, protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None = None
    ) -> Acceptor:
        """Accept from now on, in the running event loop."""
        self._listening.setblocking(False)
        work = (self._accept(protocol, tls), self._watch())
        self._tasks = [asyncio.create_task(each) for each in work]
        return self

    def close(self) -> None:
        """Accept no more; what is open stays so."""
        for task in self._tasks:
            task.cancel()

    async def wait_closed(self) -> None:
        """Return once nothing more is accepted, and close what still waits."""
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for connection in tuple(self._waiting.values()):
            connection.close()

    @contextmanager
    def kept(self, client: tuple[str, int] | None) -> Iterator[None]:
        """Spare the connection of ``client`` while something is done for it."""
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
            # An accept that need not wait gives nobody else a turn.
            await asyncio.sleep(0)

    async def _open(
        self,
        connection: _Connection,
        protocol: Callable[[], asyncio.Protocol],
        tls: ssl.SSLContext | None,
    ) -> None:
        loop = asyncio.get_running_loop()
        patience = None if tls is None else WAITING_TIMEOUT
        with suppress(OSError):
            connection.transport, _ = await loop.connect_accepted_socket(
                protocol, connection.sock, ssl=tls, ssl_handshake_timeout=patience
            )

    def _wait(self, connection: _Connection) -> None:
        connection.since = asyncio.get_running_loop().time()
        # The newest stands last, even where a port of the other side is used again.
        self._waiting.pop(connection.client, None)
        self._waiting[connection.client] = connection

    def _forget(self, connection: _Connection) -> None:
        if self._waiting.get(connection.client) is connection:
            del self._waiting[connection.client]

    def _make_room(self, maximum: int) -> None:
        """Close the oldest of the address with most of them, if more than ``most`` wait."""
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
            # What came while the loop was held up itself is not read yet.
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
                # A peer that reads nothing never lets it end.
                if connection.transport is not None and connection.transport.is_closing():
                    if not connection.closing:
                        connection.closing, connection.since = True, t
                    elif t - connection.since > WAITING_TIMEOUT:
                        connection.close()

    def _report(self, what: str) -> None:
        """Log it, unless it was logged just now."""
        t = asyncio.get_running_loop().time()
        if t - self._logged.get(what, -LOG_EVERY) >= LOG_EVERY:
            self._logged = {key: at for key, at in self._logged.items() if t - at < LOG_EVERY}
            self._logged[what] = t
            log.warning("%s", what)
