"""The pipe between the arm's process and the front end's process.

The control loop has a process of its own. So slow work in the front end, such as rendering for many
viewers, cannot delay the loop, and a crash there cannot leave the arm in motion without control.
Commands and heartbeats come in by the pipe, and snapshots go out. When no message comes any more,
the arm stops.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import Actor
from katana450.arm.control.event_log import LogEntry
from katana450.arm.control.outcome import DROPPED, refused
from katana450.arm.control.scene_objects import same
from katana450.arm.runtime.clock import MonotonicClock
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.loop_timing import LoopTiming
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.outcomes import TicketOutcome
from katana450.arm.runtime.readiness import readable, writable
from katana450.arm.runtime.state_publisher import Snapshot, StatePublisher
from katana450.arm.runtime.wire import PlanNames, PlanStore
from katana450.errors import InputError

log = logging.getLogger(__name__)

PIPE_ERRORS = (EOFError, OSError)
"""Errors that a pipe raises when its other end is closed."""

PULSE_INTERVAL = 0.1
"""[s] Maximum time between two messages of the arm's process, as long as its control loop ticks."""

PULSE = b"."
"""A message that reports only that the control loop has ticked."""

COMMAND_TIMEOUT = 0.5
"""[s] Silence of the arm's process after which only a stop is sent to it."""

REPORT_INTERVAL = 1.0
"""[s] Time between two reports of the timing of the control loop."""

JOIN_TIMEOUT = 2.0
"""[s] Timeout for the end of a thread; a thread that waits to report wakes sooner."""


@dataclass(frozen=True)
class CommandMessage:
    """A command with its giver, and the number that the front end has given it."""

    number: int
    command: cmd.Command
    actor: Actor | None


@dataclass(frozen=True)
class Heartbeat:
    """A message that proves that the front end is alive."""


@dataclass(frozen=True, eq=False)
class StateMessage:
    """A snapshot with the new entries of the event log, the loop timing and new outcomes.

    Attributes:
        snapshot: the state; its ticket is the number that the front end has given the command.
        event_log: entries since the last message.
        loop_timing: timing of the control loop.
        outcomes: outcomes of commands since the last message, by the numbers of the front end.
    """

    snapshot: Snapshot
    event_log: tuple[LogEntry, ...]
    loop_timing: LoopTiming
    outcomes: tuple[TicketOutcome, ...] = ()


class ArmEnd:
    """The end of the link in the arm's process.

    It delivers commands to the mailbox and sends what the loop publishes. It stops the arm when the
    link is cut or silent.
    """

    def __init__(
        self, pipe: Connection, loop: ControlLoop, mailbox: Mailbox, silence_timeout: float
    ) -> None:
        """Create the end; ``start`` runs it.

        Args:
            pipe: the pipe to the front end.
            loop: the control loop.
            mailbox: the mailbox of that loop.
            silence_timeout: time without a message [s] after which a moving arm is stopped.
        """
        self._pipe = pipe
        self._loop = loop
        self._mailbox = mailbox
        self._silence_timeout = silence_timeout
        self._numbers: deque[tuple[int, int]] = deque([(mailbox.last_ticket, 0)])
        self._number_of: dict[int, int] = {}
        self._refused: list[TicketOutcome] = []
        self._numbering = threading.Lock()
        self._heard = time.monotonic()
        self._names = PlanNames()
        self.cut = threading.Event()
        """Set once the other end is closed."""
        self._threads = [
            threading.Thread(target=target, name=f"link {name}", daemon=True)
            for name, target in (("in", self._listen), ("out", self._show), ("watch", self._watch))
        ]

    def start(self) -> None:
        """Run the link in threads of its own until it is cut."""
        for thread in self._threads:
            thread.start()

    @property
    def silence(self) -> float:
        """Time since the last message from the front end [s]."""
        return time.monotonic() - self._heard

    def close(self) -> None:
        """Cut the link: the front end disconnects, and the arm stops."""
        self.cut.set()
        with suppress(*PIPE_ERRORS):
            self._pipe.send(None)

    def join(self) -> None:
        """Return once the threads have ended, which they do when both ends are closed."""
        for thread in self._threads:
            thread.join(JOIN_TIMEOUT)

    def _listen(self) -> None:
        try:
            while True:
                message = self._pipe.recv()
                self._heard = time.monotonic()
                if isinstance(message, CommandMessage):
                    self._put(message)
        except PIPE_ERRORS:
            self.cut.set()
            # Without a front end no command can come any more.
            self._mailbox.put(cmd.Stop())

    def _put(self, message: CommandMessage) -> None:
        if isinstance(message.command, cmd.Follow | cmd.OfferDetour):
            self._names.note(message.number, message.command.plan)
        with self._numbering:
            try:
                ticket = self._mailbox.put(message.command, message.actor)
            except InputError as error:
                # The front end has checked the command, so only the mailbox can be full.
                log.warning("A command was dropped: %s", error)
                ticket = self._mailbox.last_ticket
                self._refused.append((message.number, refused(str(error))))
            else:
                self._number_of[ticket] = message.number
            self._numbers.append((ticket, message.number))

    def _show(self) -> None:
        state_publisher = self._loop.state_publisher
        seen, reported, ticks = state_publisher.snapshot, time.monotonic(), self._loop.ticks
        try:
            event_log = state_publisher.event_log
            self._send(StateMessage(self._named(seen), event_log, state_publisher.loop_timing))
            last = event_log[-1] if event_log else None
            while not self.cut.is_set():
                snapshot = state_publisher.wait_for_change(seen, PULSE_INTERVAL)
                now = time.monotonic()
                if snapshot is seen and self._loop.ticks == ticks:
                    # A loop that does not tick must give no pulse.
                    continue
                ticks = self._loop.ticks
                if snapshot is seen and now - reported < REPORT_INTERVAL:
                    self._pipe.send_bytes(PULSE)
                    continue
                if now - reported >= REPORT_INTERVAL:
                    reported, state_publisher.loop_timing = now, self._loop.loop_timing
                fresh = _newer(state_publisher.event_log, last)
                last = fresh[-1] if fresh else last
                self._send(
                    StateMessage(
                        self._named(snapshot),
                        fresh,
                        state_publisher.loop_timing,
                        self._outcomes(snapshot.ticket),
                    )
                )
                seen = snapshot
        except PIPE_ERRORS:
            self.cut.set()

    def _send(self, message: StateMessage) -> None:
        self._pipe.send_bytes(self._names.dumped(message))

    def _named(self, snapshot: Snapshot) -> Snapshot:
        """Return ``snapshot`` with the front end's number of the last command that it includes."""
        with self._numbering:
            while len(self._numbers) > 1 and self._numbers[1][0] <= snapshot.ticket:
                self._numbers.popleft()
            return Snapshot(snapshot.state, self._numbers[0][1])

    def _outcomes(self, executed: int) -> tuple[TicketOutcome, ...]:
        """Return the new outcomes, by the numbers of the front end.

        ``executed``: the last ticket of a published snapshot. The outcomes up to it were noted
        before that snapshot; those that are missing now were displaced by newer ones.
        """
        outcomes = self._loop.state_publisher.take_outcomes()
        with self._numbering:
            # Commands of other ends, and stops by this end, have no number here.
            new = [(self._number_of.pop(ticket, None), outcome) for ticket, outcome in outcomes]
            named = [(number, outcome) for number, outcome in new if number is not None]
            named += self._refused
            self._refused.clear()
            while self._number_of and (oldest := next(iter(self._number_of))) <= executed:
                del self._number_of[oldest]
        return tuple(named)

    def _watch(self) -> None:
        while not self.cut.wait(self._silence_timeout / 4):
            silent = self.silence
            state = self._loop.state_publisher.snapshot.state
            if silent > self._silence_timeout and state.moving and state.stopped is None:
                log.error("The front end was silent for %.2f s: STOP.", silent)
                self._mailbox.put(cmd.Stop())


class FrontEnd:
    """The end of the link in the front end: it takes commands and publishes the arm's states."""

    def __init__(self, pipe: Connection, check: Callable[[cmd.Command], None]) -> None:
        """Create the end, and wait for the first snapshot.

        Args:
            pipe: the pipe to the arm's process.
            check: see ``Mailbox``.

        Raises:
            EOFError: the arm's process has closed the pipe.
        """
        self._pipe = pipe
        self._check = check
        self._sending = threading.Lock()
        self._unsent: deque[CommandMessage] = deque()
        self._number = 0
        self._plans = PlanStore()
        first = _loaded(pipe.recv_bytes(), self._plans)
        self._heard = time.monotonic()
        self.state_publisher = StatePublisher(first.snapshot, first.loop_timing)
        self.state_publisher.publish(first.snapshot, first.event_log)
        self.cut = threading.Event()
        """Set once the arm's process has closed the pipe."""
        self._thread = threading.Thread(target=self._listen, name="link", daemon=True)

    def start(self) -> None:
        """Read all states that have arrived, then follow the arm in a thread of its own.

        Between construction and start the arm may have moved, or stopped. After this call
        ``state_publisher`` holds the newest state.
        """
        with suppress(*PIPE_ERRORS):
            while readable(self._pipe.fileno()):
                self._take(self._pipe.recv_bytes())
        self._thread.start()

    @property
    def last_ticket(self) -> int:
        """The ticket of the newest command."""
        with self._sending:
            return self._number

    def deliver(self, command: cmd.Command, actor: Actor | None = None) -> int:
        """Send ``command`` of ``actor`` to the arm, and return its ticket.

        Raises InputError for a command that the arm does not support. If the arm's process does not
        answer, every command but a stop is refused.
        """
        self._check(command)
        age = self.age
        if isinstance(command, cmd.Servo):
            # An early stamp keeps delays in this process from looking like motion.
            command = replace(command, t=MonotonicClock().now())
        with self._sending:
            if command.traits.safety:
                # Unsent commands are dropped; an earlier stop is fulfilled by this one.
                unsent = (each for each in self._unsent if not each.command.traits.safety)
                self.state_publisher.outcomes.note((each.number, DROPPED) for each in unsent)
                self._unsent.clear()
            elif age > COMMAND_TIMEOUT:
                raise InputError(
                    f"The arm's process has not answered for {age:.1f} s: only STOP is accepted."
                )
            self._number += 1
            if isinstance(command, cmd.Follow | cmd.OfferDetour):
                self._plans.note(self._number, command.plan)
            self._unsent.append(CommandMessage(self._number, command, actor))
            self._flush()
            return self._number

    @property
    def age(self) -> float:
        """Time since the newest message of the arm's process [s]; a running loop has sent it.

        A message that has arrived and is not read yet counts as new.
        """
        if self.cut.is_set():
            return time.monotonic() - self._heard
        return 0.0 if readable(self._pipe.fileno()) else time.monotonic() - self._heard

    def heartbeat(self) -> None:
        """Send a heartbeat, unless commands still wait to be sent."""
        with self._sending:
            if self._flush():
                self._send(Heartbeat())

    def _flush(self) -> bool:
        """Send the waiting commands; return whether none is left. A full pipe does not block."""
        while self._unsent and self._send(self._unsent[0]):
            self._unsent.popleft()
        return not self._unsent

    def _send(self, message: CommandMessage | Heartbeat) -> bool:
        try:
            if not writable(self._pipe.fileno()):
                return False
            self._pipe.send(message)
        except PIPE_ERRORS:
            self.cut.set()
        return True

    def _listen(self) -> None:
        try:
            while True:
                self._take(self._pipe.recv_bytes())
        except PIPE_ERRORS:
            self.cut.set()

    def _take(self, data: bytes) -> None:
        """Publish the content of ``data`` from the arm's end. Raises EOFError when that closes."""
        self._heard = time.monotonic()
        if self._unsent:
            with self._sending:
                self._flush()
        if data == PULSE:
            return
        message = _loaded(data, self._plans)
        self.state_publisher.loop_timing = message.loop_timing
        seen = self.state_publisher.snapshot
        if message.snapshot.state.t != seen.state.t or message.snapshot.ticket != seen.ticket:
            self.state_publisher.publish(_known(message.snapshot, seen), message.event_log)
        # The state comes first: a client with an answer must find its command in the state.
        self.state_publisher.outcomes.note(message.outcomes)


def _known(message: Snapshot, seen: Snapshot) -> Snapshot:
    """Return ``message`` with the objects of ``seen`` if they are the same.

    Objects from the pipe are new Python objects each time, which would be taken for a change.
    """
    if not same(message.state.objects, seen.state.objects):
        return message
    return Snapshot(replace(message.state, objects=seen.state.objects), message.ticket)


def _loaded(data: bytes, plans: PlanStore) -> StateMessage:
    """Return the message in ``data`` from the arm's end. Raises EOFError when that closes."""
    message = plans.loaded(data)
    if not isinstance(message, StateMessage):
        raise EOFError
    return message


def _newer(event_log: tuple[LogEntry, ...], last: LogEntry | None) -> tuple[LogEntry, ...]:
    """Return the entries of ``event_log`` after ``last``."""
    for index in range(len(event_log) - 1, -1, -1):
        if event_log[index] is last:
            return event_log[index + 1 :]
    return event_log
