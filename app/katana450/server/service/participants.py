"""Participants of a server: pages and programs, their names, keys, and the pictures they get."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Container, Iterable
from dataclasses import dataclass, replace
from typing import Any, Protocol

from katana450.arm.control.lease import Actor, CommandChannel, Grounds, Person, Role
from katana450.arm.control.state.stop_cause import StopCause
from katana450.errors import InputError
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.identity import Identity

SHARED_SESSION = "programs"
"""Session of all programs that send single requests over HTTP, on a server without links."""

MAX_PAGES = 256
"""Number of pages that are recognised when they return."""


MAX_NAME = 24
"""Maximum number of characters of a name."""

BLANK = re.compile("[\u115f\u1160\u2800\u3164\uffa0]")
"""Printable characters that show nothing."""

RESERVED = re.compile(r"you|somebody|nobody|(the )?server|(window|program) \d+.*")
"""Names by which the page means someone else."""

MAX_MARKS = 2
"""Maximum number of marks on one letter."""

ACTS = "pressed STOP|ended it|took over|cancelled the planning|went to step|runs it from"
"""Pattern of the acts of people in sentences."""


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


class KnownPages:
    """Person and number of each page, also of pages that are closed now."""

    def __init__(self) -> None:
        """Create a memory without pages."""
        self._known: dict[str, tuple[Person, int]] = {}
        self._numbers = 0

    @property
    def people(self) -> list[Person]:
        """The persons at these pages. For any thread."""
        # A copy: other threads add people.
        return [person for person, _ in list(self._known.values())]

    def find(self, key: str) -> Person | None:
        """Return the person at the page of ``key``; None for an unknown page."""
        return self._known.get(key, (None, 0))[0]

    def recognise(
        self, key: str, identity: Identity, open_now: Container[str]
    ) -> tuple[Person, int]:
        """Return person and number of the page of ``key``; a new page gets new ones.

        ``open_now``: keys of the open pages; of the others the oldest are forgotten.
        """
        known = self._known.pop(key, None)
        person, number = known or self._new(key, identity)
        # A page that returns may have another address.
        person = replace(person, link=identity.link, address=identity.address)
        self._known[key] = (person, number)
        absent = [page for page in self._known if page not in open_now and page != key]
        for page in absent[: max(len(self._known) - MAX_PAGES, 0)]:
            del self._known[page]
        return person, number

    def rename(self, person: Person, number: int) -> None:
        """Remember the new name of ``person``."""
        self._known[person.key] = (person, number)

    def forget(self, key: str) -> None:
        """Forget the page of ``key``."""
        self._known.pop(key, None)

    def _new(self, key: str, identity: Identity) -> tuple[Person, int]:
        self._numbers += 1
        name = free_name(identity.name, self._numbers, self.people)
        return identity.person(key, name), self._numbers


def addressed(words: str, name: str) -> str:
    """Return ``words`` for the person ``name``, who is "You" where they say what that one did."""
    return re.sub(rf"^{re.escape(name)} (?={ACTS})", "You ", words).replace("You runs", "You run")


def free_name(name: str | None, number: int, others: Iterable[Person]) -> str:
    """Return ``name``, or "Window" without one, with ``number`` where it is needed."""
    name = name or f"Window {number}"
    return f"{name} ({number})" if any(other.name == name for other in others) else name


def renamed(person: Person, name: str, others: Iterable[Person]) -> Person:
    """Return ``person`` with ``name``, with single spaces.

    Raises InputError if the name is empty, too long, not printable, reserved, or that of one of
    ``others``, and for a person whose name is that of an access link.
    """
    name = " ".join(unicodedata.normalize("NFKC", name).split())
    if person.link:
        raise InputError("Your name is that of your access link. An admin can change it.")
    if name == person.name:
        return person
    if not name:
        raise InputError("The name is empty. Type at least one character.")
    if len(name) > MAX_NAME:
        raise InputError(f"The name has {len(name)} characters. The maximum is {MAX_NAME}.")
    marks = "".join("m" if unicodedata.combining(character) else " " for character in name)
    if not name.isprintable() or BLANK.search(name) or "m" * (MAX_MARKS + 1) in marks:
        raise InputError("The name has characters that cannot be shown. Choose another name.")
    if not any(character.isalnum() for character in name) or RESERVED.fullmatch(name.casefold()):
        raise InputError(f"{name} is not a name of one person. Choose another name.")
    plain = name.casefold()
    if any(other.key != person.key and other.name.casefold() == plain for other in others):
        raise InputError(f"The name {name} is taken. Choose another name.")
    return replace(person, name=name)
