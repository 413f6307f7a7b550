"""The mailbox: the only path by which other threads send commands to the control loop."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

from katana450.arm.control.commands.commands import ClearStop, Command, HoldFor, PauseFor, Stop
from katana450.arm.control.lease import Actor
from katana450.arm.control.session.stopping import joined
from katana450.arm.control.state.stop_cause import StopCause
from katana450.arm.runtime.tick import Submission
from katana450.errors import InputError

REMEMBERED = 256
"""Number of presses of STOP whose repetitions are recognised."""


class Presses:
    """Recent presses of STOP, each of which counts once."""

    def __init__(self) -> None:
        self._counted: deque[str] = deque(maxlen=REMEMBERED)

    def is_known(self, press: str | None) -> bool:
        """Return whether ``press`` was counted. A press without a name is always new."""
        return press is not None and press in self._counted

    def counts(self, stop: Stop) -> bool:
        """Remember the presses of ``stop``; return whether any is new.

        A stop whose cause names no press always counts.
        """
        new = [press for press in stop.presses if press not in self._counted]
        self._counted.extend(new)
        return bool(new) or not stop.cause.press


CAPACITY = 256
"""Maximum number of commands that wait for one tick: far more than people make in 10 ms, and few
enough to execute in one tick."""


class CommandSink(Protocol):
    """Receiver of commands, in this process or at the other end of a pipe.

    In the front end only ``CommandGate`` delivers commands. Behind it the planning threads add
    the paths of its commands.
    """

    @property
    def last_ticket(self) -> int:
        """The ticket of the newest command."""
        ...

    def deliver(self, command: Command, actor: Actor | None) -> int:
        """Leave ``command`` of ``actor`` for the next tick, and return its ticket.

        Raises InputError for an invalid command.
        """
        ...


@dataclass(frozen=True)
class Drained:
    """Content of the mailbox when a tick empties it.

    Attributes:
        submissions: the waiting commands, oldest first.
        tickets: for each submission, its ticket and those of the commands that it replaced.
        dropped: tickets of the commands that waited when a stop came.
        last: the last ticket that was given.
        repeated: causes of presses of STOP that had been counted before, by their tickets; they can
            only name who pressed.
    """

    submissions: list[Submission]
    tickets: list[list[int]]
    dropped: list[int]
    last: int
    repeated: dict[int, StopCause] = field(default_factory=dict)

    @property
    def commands(self) -> list[Command]:
        """The commands of the submissions, oldest first."""
        return [submission.command for submission in self.submissions]


class Mailbox:
    """Queue of checked commands, in the order of their arrival.

    A ticket is the number of commands put in so far. ``drain`` hands the tickets out, so that the
    loop can report the outcome of each command to its sender.
    """

    def __init__(self, check: Callable[[Command], None]) -> None:
        """Create an empty mailbox. ``check`` raises InputError for a command that is invalid."""
        self._check = check
        self._lock = threading.Lock()
        self._waiting: list[Submission] = []
        self._of_waiting: list[list[int]] = []
        self._dropped: list[int] = []
        self._repeated: dict[int, StopCause] = {}
        self._presses = Presses()
        self._tickets = 0
        self.stop_waits = threading.Event()
        """Set while a STOP waits for its tick."""
        self.command_waits = threading.Event()
        """Set while any command waits for its tick."""

    def put(self, command: Command, actor: Actor | None = None) -> int:
        """Leave ``command`` for the next tick, and return its ticket. Never blocks for long.

        Raises InputError for an invalid command, and when the mailbox is full, which refuses
        neither a stop nor a pause by the server.
        """
        self._check(command)
        with self._lock:
            self.command_waits.set()
            replaced: list[int] = []
            if isinstance(command, Stop):
                if not self._presses.counts(command):
                    # Its copies come by several paths, some of them late.
                    self._tickets += 1
                    self._repeated[self._tickets] = command.cause
                    return self._tickets
                # Never refused. Waiting commands are dropped; an earlier stop is fulfilled.
                before = zip(self._waiting, self._of_waiting, strict=True)
                self._waiting, self._of_waiting = [], []
                for submission, tickets in before:
                    if isinstance(submission.command, Stop):
                        command, actor = joined(submission.command, command), submission.actor
                        replaced.extend(tickets)
                    elif isinstance(submission.command, ClearStop) and not replaced:
                        # It ends the stop of before, so that this one has its own cause.
                        self._waiting.append(submission)
                        self._of_waiting.append(tickets)
                    else:
                        self._dropped.extend(tickets)
                self.stop_waits.set()
            elif self._waiting and command.replaces(self._waiting[-1].command):
                self._waiting.pop()
                replaced = self._of_waiting.pop()
            elif len(self._waiting) >= CAPACITY and not isinstance(command, HoldFor | PauseFor):
                raise InputError(f"{CAPACITY} commands are waiting already: send them slower.")
            self._tickets += 1
            self._waiting.append(Submission(command, actor))
            self._of_waiting.append([*replaced, self._tickets])
            return self._tickets

    def drain(self) -> Drained:
        """Remove and return all waiting commands."""
        with self._lock:
            drained = Drained(
                self._waiting, self._of_waiting, self._dropped, self._tickets, self._repeated
            )
            self._waiting, self._of_waiting, self._dropped, self._repeated = [], [], [], {}
            self.stop_waits.clear()
            self.command_waits.clear()
            return drained

    @property
    def last_ticket(self) -> int:
        """The ticket of the newest command."""
        with self._lock:
            return self._tickets
