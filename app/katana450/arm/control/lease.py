"""The lease of the arm, and the givers of commands: one person drives at a time.

Silence ends a lease. It is a value; every event makes another one. An event that is not allowed
raises a LeaseError and changes nothing. Time is an argument, in seconds on any monotonic clock.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Self

from katana450.errors import LeaseError

HEARTBEAT_INTERVAL = 0.1
"""[s] Time between two heartbeats that a client has to send while it drives."""

LEASE_TIMEOUT = 3.0
"""[s] Silence after which the lease ends. A page that reloads is back sooner; a lost one must not
keep the arm."""


RETURN_TIME = 0.5
"""[s] Heartbeats that arrive sooner after a window was closed may have been sent before that."""


class Role(Enum):
    """The rights of a person; each role includes those of the roles before it."""

    VIEWER = "viewer"
    """Watch, and stop the arm."""
    OPERATOR = "operator"
    """Drive the arm if no other person does."""
    ADMIN = "admin"
    """Take the arm from the person who drives it."""

    @property
    def may_drive(self) -> bool:
        """True if the role may drive the arm."""
        return self is not Role.VIEWER

    @property
    def may_take(self) -> bool:
        """True if the role may take the arm from its holder."""
        return self is Role.ADMIN


@dataclass(frozen=True)
class Person:
    """A person at a page, or a program.

    Attributes:
        key: identity, unique for each page; not shown to people.
        name: display name, which may change; it takes no part in comparisons.
        role: the rights.
        link: number of the access link, for the event log; empty without one.
        address: network address, for the event log; empty if it is unknown.
    """

    key: str
    name: str = field(compare=False)
    role: Role
    link: str = field(default="", compare=False)
    address: str = field(default="", compare=False)


@dataclass(frozen=True)
class Lease:
    """The right to drive the arm.

    Attributes:
        holder: the one person who may move the arm; None if the arm is free.
        heard: time of the holder's last heartbeat [s].
        waiting: the persons who have asked for the arm, in the order of their requests; never the
            holder.
        left: time at which the holder closed its window [s]; infinite while it is open. Others may
            then take the arm at once; a page that returns before that keeps it.
    """

    holder: Person | None = None
    heard: float = -math.inf
    waiting: tuple[Person, ...] = ()
    left: float = math.inf

    @property
    def driver(self) -> Person | None:
        """The holder; None while the arm is free or the holder has closed its window."""
        return self.holder if self.left == math.inf else None

    def renamed(self, person: Person) -> Self:
        """Return the lease with the new name of ``person``, where it holds or requests it."""
        waiting = tuple(person if waiter == person else waiter for waiter in self.waiting)
        holder = person if self.holder == person else self.holder
        return replace(self, holder=holder, waiting=waiting)

    def acquire(self, person: Person, t: float) -> Self:
        """Return the lease with ``person`` as its holder, if the arm is free."""
        _check_may_drive(person)
        if self.holder == person:
            raise LeaseError("You hold the arm already.")
        if self.driver is not None:
            raise LeaseError(f"{self.driver.name} holds the arm: ask for it.")
        return self._given(person, t)

    def take(self, person: Person, t: float) -> Self:
        """Return the lease with ``person`` as its holder.

        Only an admin may take it from another holder.
        """
        _check_may_drive(person)
        if self.holder == person:
            raise LeaseError("You hold the arm already.")
        if self.driver is not None and not person.role.may_take:
            raise LeaseError(f"Only an admin may take the arm from {self.driver.name}: ask for it.")
        return self._given(person, t)

    def request(self, person: Person) -> Self:
        """Return the lease with the request of ``person`` to the holder."""
        _check_may_drive(person)
        if self.driver is None:
            raise LeaseError("The arm is free: use it without a request.")
        if self.holder == person:
            raise LeaseError("You hold the arm already.")
        if person in self.waiting:
            raise LeaseError(f"You have asked {self.driver.name} already.")
        return replace(self, waiting=(*self.waiting, person))

    def withdraw(self, person: Person) -> Self:
        """Return the lease without the request of ``person``."""
        if person not in self.waiting:
            raise LeaseError("You have not asked for the arm.")
        return self._without(person)

    def decline(self, holder: Person, person: Person) -> Self:
        """Return the lease without the request of ``person``, which the holder declines."""
        self._check_holds(holder)
        if person not in self.waiting:
            raise LeaseError("The request for the arm was withdrawn.")
        return self._without(person)

    def hand_over(self, giver: Person, taker: Person, t: float) -> Self:
        """Return the lease with ``taker`` as its holder. The taker need not have asked."""
        self._check_holds(giver)
        _check_may_drive(taker)
        if taker == giver:
            raise LeaseError("You hold the arm already.")
        return self._given(taker, t)

    def release(self, person: Person) -> Self:
        """Return the free lease, released by its holder; the requests stay."""
        self._check_holds(person)
        return self._free()

    def hear(self, person: Person, t: float) -> Self:
        """Return the lease with a heartbeat of the holder at ``t`` [s].

        A heartbeat RETURN_TIME after its window was closed shows that the holder is back.
        """
        self._check_holds(person)
        back = t > self.left + RETURN_TIME
        return replace(self, heard=max(t, self.heard), left=math.inf if back else self.left)

    def close(self, person: Person, t: float) -> Self:
        """Return the lease whose holder closed its window at ``t`` [s]."""
        self._check_holds(person)
        return replace(self, left=t)

    def leave(self, person: Person) -> Self:
        """Return the lease after ``person`` has disconnected.

        The request of the person ends. A holder keeps the arm until LEASE_TIMEOUT: a connection can
        break by accident, and a reloaded page is soon back.
        """
        return self._without(person)

    def expire(self, t: float) -> Self:
        """Return the lease, freed if its holder has been silent for LEASE_TIMEOUT at ``t`` [s]."""
        if self.holder is None or self.silence(t) < LEASE_TIMEOUT:
            return self
        return self._free()

    def silence(self, t: float) -> float:
        """Return the time since the last heartbeat of the holder [s]; 0 if the arm is free."""
        return 0.0 if self.holder is None else max(t - self.heard, 0.0)

    def _free(self) -> Self:
        return replace(self, holder=None, heard=-math.inf, left=math.inf)

    def _given(self, person: Person, t: float) -> Self:
        return replace(self._without(person), holder=person, heard=t, left=math.inf)

    def _without(self, person: Person) -> Self:
        return replace(self, waiting=tuple(waiter for waiter in self.waiting if waiter != person))

    def _check_holds(self, person: Person) -> None:
        if self.holder != person:
            raise LeaseError("You do not hold the arm.")


def _check_may_drive(person: Person) -> None:
    if not person.role.may_drive:
        raise LeaseError(f"{person.name} may only watch.")


class CommandChannel(Enum):
    """Channel by which a command was given."""

    PAGE = "page"
    """The control socket of a page: bar, jog keys, instruments."""
    SCENE = "scene"
    """viser: handles, panels and ghosts."""
    WEBSOCKET = "websocket"
    """A program that uses the API on a WebSocket."""
    TCP = "TCP"
    """A program that uses the API on the TCP port."""
    HTTP = "HTTP"
    """A program that sends single requests of the API."""
    PROGRAM = "program"
    """A script that the server runs."""
    SERVER = "server"
    """The server itself: watchdogs, and the hold at a change of driver."""


class Grounds(Enum):
    """Reason for which a command was accepted."""

    LEASE = "holds the lease"
    FREE_LEASE = "took the free lease"
    PROGRAM_OWNER = "owns the program that holds the lease, or may take it from that client"
    SAFETY = "anybody may stop the arm"
    NO_DRIVER = "may clear a stop while nobody drives"
    PRESSER = "pressed STOP, or is an admin"
    """Only in recordings of earlier versions."""
    SERVER = "protection by the server"


@dataclass(frozen=True)
class Actor:
    """A participant as the giver of a command.

    Attributes:
        person: the identity, to which the lease is given.
        channel: the channel of the command.
        seen: number of revocations (``CommandGate.revocations``) at the time of the gesture, or the
            number that an API program knows; None for a command that is handled on receipt.
        grounds: why the command was accepted; None until ``CommandGate`` has accepted it.
        delay: time [s] by which the command or gesture took longer than the least delay of its
            connection; 0 if unknown.
    """

    person: Person
    channel: CommandChannel
    seen: int | None = None
    grounds: Grounds | None = None
    delay: float = field(default=0.0, compare=False)

    @property
    def key(self) -> str:
        """Identity, unique among participants; not shown to people."""
        return self.person.key

    @property
    def name(self) -> str:
        """Display name."""
        return self.person.name


SERVER = Actor(Person("", "the server", Role.VIEWER), CommandChannel.SERVER)
"""The server itself. It may stop, hold and slow down the arm, and cannot hold the lease."""
