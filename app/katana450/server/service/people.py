"""Everybody who is connected, by identity, for the list of the admins and what they do with it.

An identity is an access link; without links it is the cookie of a browser, or one program. Its key
(the *session*) can be secret, so admins name an identity by a number.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Protocol

from katana450.errors import KatanaError
from katana450.server.service.identity import Identity

log = logging.getLogger(__name__)

MAX_REMEMBERED = 1024
"""Number of identities that are remembered, beside those that are connected or kept out."""


class LinkStore(Protocol):
    """Interface of the access links, which ``AccessFile`` implements. Its methods may block."""

    def revoke(self, number: str) -> object:
        """Delete the link of ``number``. Raises KatanaError or OSError."""


@dataclass(eq=False)
class Connection:
    """An open connection of an identity.

    Attributes:
        identity: Identity of the client.
        address: Host address of the client, as the server sees it.
        key: Key of its participant; empty without one.
        kicked: Set when an admin ends the connection.
    """

    identity: Identity
    address: str
    key: str = ""
    kicked: asyncio.Event = field(default_factory=asyncio.Event)


class People:
    """The connections of all identities, and who is kept out.

    Used in the server's thread alone.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.links: LinkStore | None = None
        """The access links; None on a server without them."""
        self._connections: dict[Connection, None] = {}
        self._known: dict[str, tuple[int, Identity]] = {}
        self._counted = 0
        self._kept_out: dict[str, float] = {}
        self._writing = asyncio.Lock()
        self._tasks: set[asyncio.Task[None]] = set()

    # Connections

    @contextmanager
    def connected(self, connection: Connection) -> Iterator[None]:
        """List ``connection`` inside the ``with`` block."""
        self.add(connection)
        try:
            yield
        finally:
            self.remove(connection)

    def add(self, connection: Connection) -> None:
        """List ``connection``."""
        self._connections[connection] = None
        self._remember(connection.identity)

    def remove(self, connection: Connection) -> None:
        """Remove ``connection`` from the list."""
        self._connections.pop(connection, None)

    @property
    def connections(self) -> dict[str, list[Connection]]:
        """The open connections by session, the oldest first."""
        connections: dict[str, list[Connection]] = {}
        for connection in self._connections:
            connections.setdefault(connection.identity.session, []).append(connection)
        return connections

    def _remember(self, identity: Identity) -> None:
        number, _ = self._known.pop(identity.session, (0, identity))
        if not number:
            self._counted += 1
            number = self._counted
        self._known[identity.session] = number, identity
        if len(self._known) > MAX_REMEMBERED:
            listed = self._listed
            oldest = next(
                (session for session in self._known if session not in listed), identity.session
            )
            if oldest != identity.session:
                del self._known[oldest]

    def identity(self, number: int) -> Identity | None:
        """Return the identity with ``number``; None if it is not remembered."""
        return next((identity for known, identity in self._known.values() if known == number), None)

    @property
    def shown(self) -> dict[int, Identity]:
        """The identities that are connected or kept out, by their numbers."""
        listed = self._listed
        return {
            number: identity
            for session, (number, identity) in self._known.items()
            if session in listed
        }

    @property
    def _listed(self) -> set[str]:
        """The sessions that are connected or kept out."""
        present = {connection.identity.session for connection in self._connections}
        absent = {key for key in tuple(self._kept_out) if 0.0 < self.kept_out(key) < math.inf}
        return present | absent

    # Kick

    def kick(self, identity: Identity, seconds: float) -> int:
        """Close all connections of ``identity`` and keep it out for ``seconds``.

        Infinite ``seconds`` stand for a revoked link. Returns the number of connections. Their
        tasks close them in the next turns of the event loop.
        """
        session = identity.session
        if seconds > 0.0:
            self._kept_out[session] = self._clock() + seconds
        closed = self.connections.get(session, [])
        for connection in closed:
            connection.kicked.set()
        return len(closed)

    def let_in(self, session: str) -> None:
        """Let the identity of ``session`` in again before its time."""
        self._kept_out.pop(session, None)

    def kept_out(self, session: str) -> float:
        """Return for how long the identity is kept out [s]; 0 if it is not."""
        if session not in self._kept_out:
            return 0.0
        left = self._kept_out[session] - self._clock()
        if left <= 0.0:
            del self._kept_out[session]
        return max(left, 0.0)

    # Links

    def write(self, change: Callable[[], object], failed: Callable[[str], None]) -> None:
        """Call ``change`` of the links in a thread, because a disk can be slow.

        ``failed`` is called with the reason if it fails.
        """
        task = asyncio.ensure_future(self._write(change, failed))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _write(self, change: Callable[[], object], failed: Callable[[str], None]) -> None:
        async with self._writing:
            try:
                await asyncio.to_thread(change)
            except (KatanaError, OSError) as error:
                log.error("The access file cannot be changed: %s", error)
                failed(str(error))
