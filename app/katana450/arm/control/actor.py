"""The participant behind a command: identity, channel, and the grounds on which it may command."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from katana450.arm.control.lease import Person, Role


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
    PROGRAM_OWNER = "owns the program that holds the lease"
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
