"""Acceptor of connections in small batches, which closes idle and surplus connections.

A connection is *waiting* until a known client sends a request on it, and again once that is
answered. The number of waiting connections is bounded. One more replaces the oldest waiting
connection of the prefix that has the most of them. So no prefix can keep others out, not even
that of a reverse proxy, from which all connections come. A prefix is an IPv4 address, or the 64
bits that an IPv6 network has in common.

Connections beyond a rate, of one prefix or of all, are opened only if they send something at once,
as every STOP does. Silent ones then cost little.
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
from ipaddress import IPv6Address

from katana450.caching import cached_property
from katana450.server.service.limits import SenderBuckets, TokenBucket

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

RATE, BURST = 200.0, 400.0
"""Connections of all clients per second, and in a burst, that are opened without a condition."""

PREFIX_RATE, PREFIX_BURST = 50.0, 100.0
"""The same of one prefix."""

MAX_PREFIXES = 1024
"""Number of prefixes whose connections are counted; a new one replaces the oldest."""

FIRST_CHECK, GRACE = 0.002, 0.02
"""[s] Time until it is checked whether a connection beyond these rates has sent something, and from
then until it is closed if it has not."""

MAX_SURPLUS = 128
"""Maximum number of connections in this time; one more replaces the oldest."""

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

    @cached_property
    def prefix(self) -> str:
        """The IPv4 address, or the first 64 bits of the IPv6 address."""
        host = self.client[0].partition("%")[0]
        if ":" not in host:
            return host
        address = IPv6Address(host)
        return str(address.ipv4_mapped or address.packed[:8].hex())

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
        else:
            self.sock.close()


class Acceptor:
    """Accepts the connections of one listening socket and passes each to a protocol."""

    def __init__(self, listening: socket.socket, waiting: int = MAX_WAITING) -> None:
        """Prepare to accept from ``listening``. ``waiting``: maximum of waiting connections."""
        self._listening = listening
        self._maximum = waiting
        self._waiting: dict[tuple[str, int], _Connection] = {}
        self._busy: dict[tuple[str, int], _Connection] = {}
        self._surplus: dict[_Connection, asyncio.TimerHandle] = {}
        self._tasks: list[asyncio.Task[None]] = []
        self._logged: dict[str, float] = {}
        total = TokenBucket(RATE, BURST, 0.0)
        self._budgets = SenderBuckets(PREFIX_RATE, PREFIX_BURST, MAX_PREFIXES, total)

    def start(
        self, protocol: Callable[[], asyncio.Protocol], tls: ssl.SSLContext | None = None
    ) -> Acceptor:
        """Start to accept connections in the running event loop."""
        self._listening.setblocking(False)
        self._protocol, self._tls = protocol, tls
        work = (self._accept(), self._watch())
        self._tasks = [asyncio.create_task(coroutine) for coroutine in work]
        return self

    def close(self) -> None:
        """Stop accepting; open connections stay open."""
        for task in self._tasks:
            task.cancel()

    async def wait_closed(self) -> None:
        """Wait until accepting has ended, then close the waiting connections."""
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for timer in self._surplus.values():
            timer.cancel()
        for connection in (*self._waiting.values(), *self._surplus):
            connection.close()
        self._surplus.clear()

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

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            for _ in range(ACCEPT_BATCH):
                try:
                    sock, address = await loop.sock_accept(self._listening)
                except OSError as error:
                    self._report("A connection could not be accepted: %s.", error.strerror)
                    # A client that disconnected in the queue leaves room for the next.
                    if error.errno in NO_DESCRIPTOR_ERRORS:
                        self._make_room(self._maximum // 2)
                        await asyncio.sleep(BACK_OFF)
                    break
                connection = _Connection(sock, (address[0], address[1]), loop.time())
                if self._budgets.take(connection.prefix, connection.since):
                    self._admit(connection)
                    continue
                timer = loop.call_later(FIRST_CHECK, self._judge, connection, GRACE)
                self._surplus[connection] = timer
                if len(self._surplus) > MAX_SURPLUS:
                    self._judge(next(iter(self._surplus)))
            # An accept that returns at once does not yield to other tasks.
            await asyncio.sleep(0)

    def _judge(self, connection: _Connection, grace: float = 0.0) -> None:
        """Open the surplus ``connection`` if it has sent something; else close it after ``grace``.

        ``grace`` is in seconds.
        """
        self._surplus[connection].cancel()
        sent = False
        with suppress(OSError):
            sent = connection.sock.recv(1, socket.MSG_PEEK) != b""
        if not sent and grace > 0.0:
            loop = asyncio.get_running_loop()
            self._surplus[connection] = loop.call_later(grace, self._judge, connection)
            return
        del self._surplus[connection]
        if sent:
            self._admit(connection)
        else:
            host = connection.client[0]
            self._report("Too many connections per second; closed a silent one of %s.", host)
            connection.close()

    def _admit(self, connection: _Connection) -> None:
        connection.opening = asyncio.create_task(self._open(connection))
        self._wait(connection)
        if len(self._waiting) > self._maximum:
            self._make_room(self._maximum)

    async def _open(self, connection: _Connection) -> None:
        loop, tls = asyncio.get_running_loop(), self._tls
        timeout = None if tls is None else WAITING_TIMEOUT
        with suppress(OSError):
            connection.transport, _ = await loop.connect_accepted_socket(
                self._protocol, connection.sock, ssl=tls, ssl_handshake_timeout=timeout
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
        """Close the oldest connection of the commonest prefix if more than ``maximum`` wait."""
        for connection in tuple(self._waiting.values()):
            if not connection.open:
                self._forget(connection)
        if len(self._waiting) <= maximum:
            return
        prefixes = Counter(connection.prefix for connection in self._waiting.values())
        crowded, _ = prefixes.most_common(1)[0]
        oldest = next(
            candidate for candidate in self._waiting.values() if candidate.prefix == crowded
        )
        self._report("Too many connections wait; closed the oldest of %s.", oldest.client[0])
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

    def _report(self, problem: str, value: object) -> None:
        """Log ``problem`` with its ``value``, but not more often than every ``LOG_EVERY``.

        Addresses belong into ``value``: the times of thousands of texts would take long to keep.
        """
        t = asyncio.get_running_loop().time()
        if t - self._logged.get(problem, -LOG_EVERY) >= LOG_EVERY:
            self._logged[problem] = t
            log.warning(problem, value)
