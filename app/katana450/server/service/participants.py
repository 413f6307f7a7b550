"""Participants of a server: pages and programs, their keys, and the pictures that they get."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

from katana450.arm.control.actor import Actor, CommandChannel, Grounds
from katana450.arm.control.lease import Person, Role
from katana450.arm.control.state.stop_cause import StopCause
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.identity import Identity

SHARED_SESSION = "programs"
"""Session of all programs that send single requests over HTTP, on a server without links."""


@dataclass(eq=False)
class Participant:
    """The record of one connected page or program.

    Attributes:
        person: Person and role; a person may choose another name.
        number: Number, counted up from 1.
        notify: Function that queues a notice to the client.
        heartbeat: Newest heartbeat.
        channel: Channel of its commands.
        gives_back: Whether the lease is released at the end of the motion that a request waits for,
            because that request has acquired it.
    """

    person: Person
    number: int
    notify: Callable[[dict[str, Any]], None]
    heartbeat: LastHeartbeat
    channel: CommandChannel
    gives_back: bool = False

    @property
    def actor(self) -> Actor:
        """The participant as the actor of a command that is handled on receipt."""
        return Actor(self.person, self.channel)


class Takeover(NamedTuple):
    """The newest take-over of the lease. ``drivers``: keys of those that drove before."""

    taker: Person
    drivers: frozenset[str]

    def taker_from(self, person: Person, holder: Person | None) -> str | None:
        """Return the name of the taker if it took over from ``person`` and is the ``holder``."""
        took = person.key in self.drivers and holder == self.taker
        return self.taker.name if took else None


def actor_of(identity: Identity, channel: CommandChannel, address: str = "") -> Actor:
    """Return ``identity`` as the actor of a command or request, without being connected.

    ``address``: network address of the client, if ``identity`` has none.
    """
    person = identity.person(identity.session, identity.name or "Somebody")
    return Actor(replace(person, address=address or person.address), channel)


def presser_of(cause: StopCause, known: Iterable[Person], *, links: bool) -> Actor | None:
    """Return the participant that pressed STOP on the port of STOP; None for a watchdog.

    ``known``: participants of the main port, for what ``cause`` does not name. ``links``: whether
    the server requires access links; the role of an unknown bearer is the least one.
    """
    if cause.by is None:
        return None
    session = session_of(cause.key)
    channel = CommandChannel.HTTP if session == cause.key else CommandChannel.PAGE
    role, link = (Role.VIEWER, session) if links else (Role.ADMIN, "")
    person = Person(cause.key, cause.by, role, link)
    for other in known:
        if other.key == cause.key:
            person = other
            break
        if session_of(other.key) == session:
            person = replace(person, role=other.role)
    return Actor(person, channel, grounds=Grounds.SAFETY)


def key_of(identity: Identity, page: str) -> str:
    """Return the key that the sockets of one page have in common."""
    return f"{identity.session}/{page}"


def session_of(key: str) -> str:
    """Return the session in the ``key`` of a participant, or of an actor that is not connected."""
    return key.rpartition("/")[0] or key


class MeasuresAge(Protocol):
    """Interface for the age of a window's picture; ``Flow`` implements it."""

    def age(self, t: float) -> float:
        """Return the age of the picture [s] at time ``t`` [s]."""


class ShownPictures:
    """The connections of pages to viser, each with the window that it belongs to."""

    def __init__(self) -> None:
        """Begin without connections."""
        self._windows: dict[MeasuresAge, str] = {}

    def show(self, key: str, picture: MeasuresAge) -> None:
        """Add a connection of the window ``key``. ``picture`` measures the age of its picture."""
        self._windows[picture] = key

    def hide(self, picture: MeasuresAge) -> None:
        """Remove a closed connection."""
        del self._windows[picture]

    @property
    def watching(self) -> int:
        """Number of browsers that get pictures."""
        return len(self._windows)

    def age(self, key: str, t: float) -> float:
        """Return the age of the picture that the window ``key`` shows at ``t`` [s]."""
        pictures = [picture for picture, window in self._windows.items() if window == key]
        return pictures[-1].age(t) if pictures else 0.0
