"""The answer to ``list_people``."""

from __future__ import annotations

import msgspec

from katana450.server.api.fields import Answer


class PersonConnection(msgspec.Struct, frozen=True, kw_only=True):
    """An open connection of a person.

    Attributes:
        kind: ``page``; ``scene``, the 3D view of a page; ``program`` on a websocket; ``lines``, a
            program on the TCP port; ``posts``, a program that sends single requests over HTTP.
        name: Name of the page or program that others see.
        number: Number of the page or program, for ``give``; null for a scene.
        address: Address of the client, as the server sees it.
        since: Time at which it was opened, in UTC, in ISO 8601.
    """

    kind: str
    name: str
    number: int | None
    address: str
    since: str


class ConnectedPerson(msgspec.Struct, frozen=True, kw_only=True):
    """A person with all connections: everybody who uses one link; without links, one browser.

    Attributes:
        person: Number for ``kick``.
        name: Name of the link or, without links, of the first page or program.
        role: viewer, operator or admin.
        link: Number of the access link; null without links.
        you: Whether this is the person who asks.
        drives: Whether the person holds the lease, or owns the program that holds it.
        asks: Whether the person asks for the lease.
        program: Name of the running program that the person owns; null without one.
        refused: Number of requests that were refused so far.
        kept_out: Time [s] for which the person is kept out; null unless kicked.
        connections: Open connections, the oldest first.
    """

    person: int
    name: str
    role: str
    link: str | None
    you: bool
    drives: bool
    asks: bool
    program: str | None
    refused: int
    kept_out: float | None
    connections: tuple[PersonConnection, ...]


class People(Answer, frozen=True, kw_only=True):
    """Everybody who is connected or kept out."""

    people: tuple[ConnectedPerson, ...]
