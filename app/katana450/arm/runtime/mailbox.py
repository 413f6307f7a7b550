"""The only way from other threads into the control loop."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple, Protocol

from katana450.arm.control.actor import Actor
from katana450.arm.control.commands import Command
from katana450.errors import InputError

CAPACITY = 256
"""Commands that may wait for one tick: far more than people make in 10 ms, few enough to do."""


class Submission(NamedTuple):
    """A command and its giver; None where the process of the arm acts by itself."""

    command: Command
    actor: Actor | None


class CommandSink(Protocol):
    """Takes commands, here or at the end of a pipe.

    In the process that people speak to, ``CommandGate.submit`` alone puts commands into one.
    """

    @property
    def last_ticket(self) -> int:
        """The ticket of the newest command."""
        ...

    def deliver(self, command: Command, actor: Actor | None) -> int:
        """Leave ``command`` of ``actor`` for the next tick; returns its ticket.

        Raises InputError.
        """
        ...


class Mailbox:
    """Commands in the order they came, each checked at the door.

    A ticket is the number of commands put in so far; ``drain`` hands out the last one, so that a
    sender can tell from the loop's next snapshot whether what it said has been taken.
    """

    def __init__(self, check: Callable[[Command], None]) -> None:
        """``check`` raises an InputError for a command that must not enter."""
        self._check = check
        self._lock = threading.Lock()
        self._waiting: list[Submission] = []
        self._tickets = 0

    def put(self, command: Command, actor: Actor | None = None) -> int:
        """Leave ``command`` for the next tick; returns its ticket. Never blocks for long."""
        self._check(command)
        submission = Submission(command, actor)
        with self._lock:
            if command.traits.safety:
                # Never refused, and what waits before it is dead the moment it comes.
                self._waiting = [submission]
            elif self._waiting and command.replaces(self._waiting[-1].command):
                self._waiting[-1] = submission
            elif len(self._waiting) >= CAPACITY:
                raise InputError(f"{CAPACITY} commands are waiting already: send them slower.")
            else:
                self._waiting.append(submission)
            self._tickets += 1
            return self._tickets

    def drain(self) -> tuple[list[Submission], int]:
        """Everything that waits, oldest first, and the last ticket given."""
        with self._lock:
            waiting, self._waiting = self._waiting, []
            return waiting, self._tickets

    @property
    def last_ticket(self) -> int:
        """The ticket of the newest command."""
        with self._lock:
            return self._tickets
