"""The arm's end of the pipe to the front end's process; ``front_end`` is the other end.

The control loop has a process of its own. So slow work in the front end, such as rendering for many
viewers, cannot delay the loop, and a crash there cannot leave the arm in motion without control.
Commands and heartbeats come in by the pipe, and snapshots go out. When the pipe is cut, the arm
stops. When it is silent, a moving arm stops, or pauses if it is simulated.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor
from katana450.arm.control.session.checks import refused
from katana450.arm.control.session.stopping import SilenceProfile
from katana450.arm.control.state.state import Finding, Reason
from katana450.arm.runtime.loop import ControlLoop
from katana450.arm.runtime.mailbox import Mailbox
from katana450.arm.runtime.pipes.guarded_pipe import GuardedPipe
from katana450.arm.runtime.pipes.state_publisher import LoopTiming, Snapshot, TicketOutcome
from katana450.arm.runtime.pipes.wire import PlanNames, plan_of
from katana450.arm.runtime.readiness import writable
from katana450.errors import InputError

log = logging.getLogger(__name__)

PULSE_INTERVAL = 0.1
"""[s] Maximum time between two messages of the arm's process, as long as its control loop ticks."""

PULSE = b"."
"""A message that reports only that the control loop has ticked."""

REPORT_INTERVAL = 1.0
"""[s] Time between two reports of the timing of the control loop."""

OLDER_THAN_PAUSE = "The arm has just paused. Give the command again."
"""Reason for the refusal of a command that is older than the pause."""

JOIN_TIMEOUT = 2.0
"""[s] Timeout for the end of a thread; a thread that waits to report wakes sooner."""


@dataclass(frozen=True)
class CommandMessage:
    """A command as the front end sends it.

    Attributes:
        number: its number, given by the front end.
        command: the command.
        actor: its giver.
        seen: time of the newest state [s] that the front end knew.
    """

    number: int
    command: cmd.Command
    actor: Actor | None
    seen: float


@dataclass(frozen=True)
class Heartbeat:
    """A message that proves that the front end is alive."""


@dataclass(frozen=True, eq=False)
class StateMessage:
    """A snapshot with the loop timing and new outcomes.

    Attributes:
        snapshot: the state; its ticket is the number that the front end has given the command.
        loop_timing: timing of the control loop.
        outcomes: outcomes of commands since the last message, by the numbers of the front end.
        profile: reaction of the moving arm to silence.
    """

    snapshot: Snapshot
    loop_timing: LoopTiming
    outcomes: tuple[TicketOutcome, ...] = ()
    profile: SilenceProfile = SilenceProfile.REAL_ARM


class ArmEnd:
    """The end of the pipe in the arm's process.

    It delivers commands to the mailbox and sends what the loop publishes. It stops the arm when the
    pipe is cut. When the pipe is silent, a moving arm stops, or pauses if it is simulated.
    """

    def __init__(
        self,
        pipe: Connection,
        loop: ControlLoop,
        mailbox: Mailbox,
        silence_timeout: float,
        number: int = 0,
    ) -> None:
        """Create the end; ``start`` runs it.

        Args:
            pipe: the pipe to the front end.
            loop: the control loop.
            mailbox: the mailbox of that loop.
            silence_timeout: time without a message [s] after which a moving arm brakes.
            number: the number that the front end gave its newest command before it connected.
        """
        self._pipe = pipe
        self._loop = loop
        self._mailbox = mailbox
        self._silence_timeout = silence_timeout
        self._numbers: deque[tuple[int, int]] = deque([(mailbox.last_ticket, number)])
        self._number_of: dict[int, int] = {}
        self._refused: list[TicketOutcome] = []
        self._numbering = threading.Lock()
        self._heard = time.monotonic()
        self._names = PlanNames()
        self.cut = threading.Event()
        """Set once the other end is closed."""
        self._threads = [
            threading.Thread(target=self._serve, args=(work,), name=f"pipe {name}", daemon=True)
            for name, work in (("in", self._listen), ("out", self._show), ("watch", self._watch))
        ]

    def start(self) -> None:
        """Serve the pipe in threads of its own until it is cut."""
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """Cut the pipe: the front end disconnects, and the arm stops."""
        self._lose()

    def join(self) -> None:
        """Return once the threads have ended, which they do when both ends are closed."""
        for thread in self._threads:
            thread.join(JOIN_TIMEOUT)

    def _serve(self, work: Callable[[], None]) -> None:
        with GuardedPipe(self._pipe, "The pipe to the page's server", self._lose):
            work()

    def _listen(self) -> None:
        while not self.cut.is_set():
            message = self._pipe.recv()
            self._heard = time.monotonic()
            if isinstance(message, CommandMessage) and not self.cut.is_set():
                self._put(message)

    def _lose(self) -> None:
        """Stop the arm, unless the pipe is cut already: no command can come any more."""
        if not self.cut.is_set():
            self.cut.set()
            self._mailbox.put(cmd.Stop())

    def _put(self, message: CommandMessage) -> None:
        plan = plan_of(message.command)
        if plan is not None:
            self._names.note(message.number, plan)
        with self._numbering:
            try:
                moves = not all(part.traits.while_stopped for part in message.command.parts)
                if moves and message.seen < self._loop.paused_at:
                    raise InputError(OLDER_THAN_PAUSE)
                ticket = self._mailbox.put(message.command, message.actor)
            except InputError as error:
                # The front end has checked the command: it came too late, or the mailbox is full.
                log.warning("A command was dropped: %s", error)
                ticket = self._mailbox.last_ticket
                self._refused.append((message.number, refused(str(error))))
            else:
                self._number_of[ticket] = message.number
            self._numbers.append((ticket, message.number))

    def _show(self) -> None:
        state_publisher = self._loop.state_publisher
        shown, reported, ticks = state_publisher.snapshot, time.monotonic(), self._loop.ticks
        timing, profile = state_publisher.loop_timing, self._loop.profile
        self._send(StateMessage(self._named(shown), timing, profile=profile))
        while not self.cut.is_set():
            snapshot = state_publisher.wait_for_change(shown, PULSE_INTERVAL)
            if self.cut.is_set():
                # The stop of this end is no news for a front end that disconnects.
                break
            now = time.monotonic()
            if snapshot is shown and self._loop.ticks == ticks:
                # A loop that does not tick must give no pulse.
                continue
            ticks = self._loop.ticks
            if snapshot is shown and now - reported < REPORT_INTERVAL:
                self._pipe.send_bytes(PULSE)
                continue
            if now - reported >= REPORT_INTERVAL:
                reported, state_publisher.loop_timing = now, self._loop.loop_timing
            self._send(
                StateMessage(
                    self._named(snapshot),
                    state_publisher.loop_timing,
                    self._outcomes(snapshot.ticket),
                    profile,
                )
            )
            shown = snapshot
        # A front end that hangs reads nothing, and its pipe may be full.
        if writable(self._pipe.fileno()):
            self._pipe.send(None)

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
        # One check for each timeout in which the other end is heard, and a little after its end.
        slack = self._silence_timeout / 8
        silent = 0.0
        while not self.cut.wait(max(self._silence_timeout - silent, 0.0) + slack):
            silent = time.monotonic() - self._heard
            if silent > self._silence_timeout:
                self._loop.brake(Finding(Reason.SERVER_SILENT, silent), silent)
