"""Between the process that moves the arm and the one that people and programs speak to.

What takes long over there, pictures for a crowd above all, must not make the control loop late, and
what crashes there must not let the arm go on. So the loop has a process of its own. Commands and
heartbeats come in by a pipe, snapshots go out; when nothing comes any more the arm stops.
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
"""What a pipe raises when there is nobody at its other end."""

PULSE_EVERY = 0.1
"""[s] Between two words of the arm's process at least, as long as its control loop ticks."""

PULSE = b"."
"""Says only that the control loop has ticked."""

COMMAND_TIMEOUT = 0.5
"""[s] Without a word of the arm's process, after which it is given no command but a stop."""

REPORT_EVERY = 1.0
"""[s] Between two reports of how late the ticks are."""

ENDING_SECONDS = 2.0
"""[s] A thread that waits to report wakes sooner."""


@dataclass(frozen=True)
class CommandMessage:
    """A command with its giver, and the front's own number for it."""

    number: int
    command: cmd.Command
    actor: Actor | None


@dataclass(frozen=True)
class Heartbeat:
    """A heartbeat."""


@dataclass(frozen=True, eq=False)
class StateMessage:
    """A snapshot, whose ticket is the front's number; what is new in the event log; how late it is.

    outcomes: what became of commands since the last, by the front's numbers.
    """

    snapshot: Snapshot
    event_log: tuple[LogEntry, ...]
    loop_timing: LoopTiming
    outcomes: tuple[TicketOutcome, ...] = ()


class ArmEnd:
    """The end at the arm: puts in what is told, shows what the loop does, stops when it is cut."""

    def __init__(
        self, pipe: Connection, loop: ControlLoop, mailbox: Mailbox, silence: float
    ) -> None:
        """``silence``: [s] without a word that stops an arm that moves."""
        self._pipe = pipe
        self._loop = loop
        self._mailbox = mailbox
        self._silence = silence
        self._numbers: deque[tuple[int, int]] = deque([(mailbox.last_ticket, 0)])
        self._number_of: dict[int, int] = {}
        self._refused: list[TicketOutcome] = []
        self._numbering = threading.Lock()
        self._heard = time.monotonic()
        self._names = PlanNames()
        self.cut = threading.Event()
        """Set once there is nobody at the other end."""
        self._threads = [
            threading.Thread(target=target, name=f"link {name}", daemon=True)
            for name, target in (("in", self._listen), ("out", self._show), ("watch", self._watch))
        ]

    def start(self) -> None:
        """In threads of its own, until it is cut."""
        for thread in self._threads:
            thread.start()

    @property
    def unheard(self) -> float:
        """[s] Since anything came from the other end."""
        return time.monotonic() - self._heard

    def close(self) -> None:
        """Cut it: the other end hangs up, and the arm stops."""
        self.cut.set()
        with suppress(*PIPE_ERRORS):
            self._pipe.send(None)

    def join(self) -> None:
        """Return once its threads have ended, as they do when both ends are closed."""
        for thread in self._threads:
            thread.join(ENDING_SECONDS)

    def _listen(self) -> None:
        try:
            while True:
                said = self._pipe.recv()
                self._heard = time.monotonic()
                if isinstance(said, CommandMessage):
                    self._put(said)
        except PIPE_ERRORS:
            self.cut.set()
            # Nobody is left who could say where to go on to.
            self._mailbox.put(cmd.Stop())

    def _put(self, message: CommandMessage) -> None:
        if isinstance(message.command, cmd.Follow):
            self._names.note(message.number, message.command.plan)
        with self._numbering:
            try:
                ticket = self._mailbox.put(message.command, message.actor)
            except InputError as error:
                # Checked over there, so only too many at once can be wrong with it.
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
                snapshot = state_publisher.wait_for_change(seen, PULSE_EVERY)
                now = time.monotonic()
                if snapshot is seen and self._loop.ticks == ticks:
                    # A loop that does not tick gives no heartbeat.
                    continue
                ticks = self._loop.ticks
                if snapshot is seen and now - reported < REPORT_EVERY:
                    self._pipe.send_bytes(PULSE)
                    continue
                if now - reported >= REPORT_EVERY:
                    reported, state_publisher.loop_timing = now, self._loop.loop_timing
                fresh = _newer(state_publisher.event_log, last)
                last = fresh[-1] if fresh else last
                self._send(
                    StateMessage(
                        self._named(snapshot), fresh, state_publisher.loop_timing, self._outcomes()
                    )
                )
                seen = snapshot
        except PIPE_ERRORS:
            self.cut.set()

    def _send(self, message: StateMessage) -> None:
        self._pipe.send_bytes(self._names.dumped(message))

    def _named(self, snapshot: Snapshot) -> Snapshot:
        """``snapshot`` with the front's number of the last command that is in it."""
        with self._numbering:
            while len(self._numbers) > 1 and self._numbers[1][0] <= snapshot.ticket:
                self._numbers.popleft()
            return Snapshot(snapshot.state, self._numbers[0][1])

    def _outcomes(self) -> tuple[TicketOutcome, ...]:
        """Return what is new of the outcomes, by the front's numbers."""
        told = self._loop.state_publisher.take_outcomes()
        with self._numbering:
            # Those of other ends, and the stops of this one, have no number here.
            new = [(self._number_of.pop(ticket, None), outcome) for ticket, outcome in told]
            named = [(number, outcome) for number, outcome in new if number is not None]
            named += self._refused
            self._refused.clear()
        return tuple(named)

    def _watch(self) -> None:
        while not self.cut.wait(self._silence / 4):
            silent = self.unheard
            state = self._loop.state_publisher.snapshot.state
            if silent > self._silence and state.moving and state.stopped is None:
                log.error("Nothing was heard from the page's server for %.2f s: STOP.", silent)
                self._mailbox.put(cmd.Stop())


class FrontEnd:
    """The end where people and programs are: a mailbox that reaches over, and a board."""

    def __init__(self, pipe: Connection, check: Callable[[cmd.Command], None]) -> None:
        """Waits for the first snapshot. ``check``: see ``Mailbox``. Raises EOFError."""
        self._pipe = pipe
        self._check = check
        self._sending = threading.Lock()
        self._unsent: deque[CommandMessage] = deque()
        self._number = 0
        self._plans = PlanStore()
        first = _loaded(pipe.recv_bytes(), self._plans)
        self._heard = time.monotonic()
        self.state_publisher = StatePublisher(first.snapshot, first.loop_timing)
        self.state_publisher.pin(first.snapshot, first.event_log)
        self.cut = threading.Event()
        """Set once there is no arm any more."""
        self._thread = threading.Thread(target=self._listen, name="link", daemon=True)

    def start(self) -> None:
        """Take in all states that have arrived, then follow the arm in a thread of its own.

        Between construction and start the arm may have moved, or stopped: after this call
        ``board`` holds the newest state.
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
        """Send ``command`` of ``actor`` to the arm; returns its ticket.

        Raises InputError for a command that the arm cannot be given.

        Where the arm's process does not answer, only a stop is sent.
        """
        self._check(command)
        age = self.age
        if isinstance(command, cmd.Servo):
            # The sooner it is stamped, the less of our own delays looks like its motion.
            command = replace(command, t=MonotonicClock().now())
        with self._sending:
            if command.traits.safety:
                # What has not gone yet is dropped; an earlier stop is fulfilled by this one.
                unsent = (each for each in self._unsent if not each.command.traits.safety)
                self.state_publisher.outcomes.note((each.number, DROPPED) for each in unsent)
                self._unsent.clear()
            elif age > COMMAND_TIMEOUT:
                raise InputError(
                    f"The arm's process has not answered for {age:.1f} s: only STOP is accepted."
                )
            self._number += 1
            if isinstance(command, cmd.Follow):
                self._plans.note(self._number, command.plan)
            self._unsent.append(CommandMessage(self._number, command, actor))
            self._flush()
            return self._number

    @property
    def age(self) -> float:
        """Time since the newest word of the arm's process [s], which came from a running loop.

        What came and is not read yet counts as new.
        """
        if self.cut.is_set():
            return time.monotonic() - self._heard
        return 0.0 if readable(self._pipe.fileno()) else time.monotonic() - self._heard

    def heartbeat(self) -> None:
        """Give a heartbeat."""
        with self._sending:
            if self._flush():
                self._send(Heartbeat())

    def _flush(self) -> bool:
        """Send what waits; whether nothing waits any more. A full pipe keeps nobody waiting."""
        while self._unsent and self._send(self._unsent[0]):
            self._unsent.popleft()
        return not self._unsent

    def _send(self, said: CommandMessage | Heartbeat) -> bool:
        try:
            if not writable(self._pipe.fileno()):
                return False
            self._pipe.send(said)
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
        """Publish what ``data`` from the arm's end reports. Raises EOFError when that hangs up."""
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
            self.state_publisher.pin(_known(message.snapshot, seen), message.event_log)
        # After the state: a client that is answered finds one with its command in it.
        self.state_publisher.outcomes.note(message.outcomes)


def _known(message: Snapshot, seen: Snapshot) -> Snapshot:
    """``news`` with the objects of ``seen`` where they are the same.

    What comes by the pipe is another object each time, which would be taken for a change.
    """
    if not same(message.state.objects, seen.state.objects):
        return message
    return Snapshot(replace(message.state, objects=seen.state.objects), message.ticket)


def _loaded(data: bytes, plans: PlanStore) -> StateMessage:
    """What ``data`` from the arm's end says; EOFError when that hangs up."""
    message = plans.loaded(data)
    if not isinstance(message, StateMessage):
        raise EOFError
    return message


def _newer(event_log: tuple[LogEntry, ...], last: LogEntry | None) -> tuple[LogEntry, ...]:
    """What stands in ``event_log`` behind ``last``."""
    for index in range(len(event_log) - 1, -1, -1):
        if event_log[index] is last:
            return event_log[index + 1 :]
    return event_log
