"""The only path of a command to the arm, on which lease and stop are checked."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, Self

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import SERVER, Actor, CommandChannel, Grounds, Lease, Person
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.state import CAUSES, Finding, State
from katana450.arm.control.state.stop_cause import StopCause, pressed
from katana450.arm.runtime.mailbox import Presses
from katana450.arm.runtime.pipes.state_publisher import Snapshot
from katana450.errors import InputError, KatanaError, LeaseError
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.heartbeats import check_in_time
from katana450.server.service.recorder import Recorder
from katana450.settings import Settings

log = logging.getLogger(__name__)

SETTLE_TIME = 0.3
"""[s] Time after a pause in which commands are refused: three intervals of the heartbeats, so that
messages which waited meanwhile have arrived."""


STREAM_GAP, STREAM_TIMEOUT = 0.5, 1.0
"""[s] Maximum time between two samples of a client that streams, and after the newest one."""


@dataclass(frozen=True)
class StopRecord:
    """A stop and its cause.

    Attributes:
        cause: Cause of the stop, with the participant that pressed STOP.
        ticket: Ticket of the newest stop sent to the arm; None before one was sent.
        confirmed: Whether a state of the arm that is newer than the request is stopped.
    """

    cause: StopCause
    ticket: int | None = None
    confirmed: bool = False

    @property
    def why(self) -> str:
        """Reason in words."""
        return self.cause.why

    @property
    def stage(self) -> str:
        """Stage of the stop: ``requested``, then ``confirmed`` by a state of the arm."""
        return "confirmed" if self.confirmed else "requested"

    def requested(self, ticket: int) -> Self:
        """Return the record of the stop sent (again) as ``ticket``, not confirmed yet."""
        return replace(self, ticket=ticket, confirmed=False)

    def seen(self, snapshot: Snapshot) -> Self:
        """Return the record, confirmed if ``snapshot`` includes the request and is stopped."""
        if self.confirmed or self.ticket is None or snapshot.ticket < self.ticket:
            return self
        return self if snapshot.state.stopped is None else replace(self, confirmed=True)


class RunningProgram(NamedTuple):
    """Participant as which a program holds the lease, and the key of the program's owner."""

    person: Person
    owner: str


class Takeover(NamedTuple):
    """The arm was taken from a script, or from a client of the API such as a policy, by moving it.

    Attributes:
        driver: the script or client; a client may be given the arm back.
        by: key of the person who moved it.
        state: the state before.
        since: time since which the driver had driven [s since the epoch].
    """

    driver: Person
    by: str
    state: State
    since: float


class CommandGate:
    """Gate that accepts or refuses each command. Every method may be called in any thread.

    A lock puts commands, stops and changes of the lease into one order. A gesture can be older than
    its place in that order: it can wait in viser's socket while a stop arrives and is cleared. So
    each gesture carries the number of revocations at its receipt (``Actor.seen``), and the gate
    refuses an older number. It also refuses a sample with a delay above ``sample_delay`` [s].
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        """Create a gate without an arm. ``clock`` is in seconds."""
        self._clock = clock
        self.sample_delay = Settings.sample_delay
        self.lock = threading.RLock()
        """Lock that keeps other commands, stops and changes of the lease out."""
        self.lease = Lease()
        self.stopped: StopRecord | None = None
        self.arm: ArmHandle | None = None
        """The arm; None until it is ready."""
        self.program: RunningProgram | None = None
        """The running program; None without one."""
        self.ended: RunningProgram | None = None
        """The program that was interrupted last, until a participant gets the lease."""
        self.takeover: Takeover | None = None
        """The newest takeover, while the person who took over drives."""
        self.is_client: Callable[[Person], bool] = lambda _: False
        """Function that returns whether a person is a connected client of the API."""
        self._held_since = 0.0
        # Times of the last two samples of the driver.
        self._samples = -math.inf, -math.inf
        self.revocations = self.motions = 0
        """Number of stops and losses of the lease; of commands that superseded a motion."""
        self.on_stop: Callable[[], None] = lambda: None
        """Callback at each stop, before the arm gets it."""
        self.recorder = Recorder()
        """Notes commands, stops and changes of the lease for the event log."""
        self.presser_of: Callable[[StopCause], Actor | None] = lambda _: None
        """Function that returns the participant that pressed STOP; None for another cause."""
        self.delivered: list[Callable[[cmd.Command, Actor, State, bool], None]] = []
        """Callbacks with command, actor, the state before, and whether that includes all before."""
        self._presses = Presses()
        self._cleared = 0
        self._jogged = -cmd.JOG_TIME
        self._waits = False
        self._settled = -SETTLE_TIME

    def submit(self, command: cmd.Command, actor: Actor) -> int:
        """Send ``command`` of ``actor`` to the arm; return its ticket.

        Acquire the lease for ``actor`` if it is free. The ticket of a stop, or of clearing one, is
        0 while there is no arm. Raises LeaseError if ``actor`` may not give the command now, and
        InputError for a command that the arm cannot accept.
        """
        with self.lock:
            if isinstance(command, cmd.Stop):
                return self._press(command, actor)
            try:
                if isinstance(command, cmd.ClearStop):
                    granted, ticket = self._clear_stop(actor)
                else:
                    granted = self._checked(command, actor)
                    # What follows from the command later is void after a revocation.
                    granted = replace(granted, seen=self.revocations)
                    arm = self.present()
                    before, caught_up = arm.state, arm.caught_up
                    ticket = arm.deliver(command, granted)
                    self.motions += any(part.traits.supersedes for part in command.parts)
                    for note in self.delivered:
                        guarded(partial(note, command, granted, before, caught_up))()
            except KatanaError as error:
                self.recorder.refuse(command, actor, error)
                raise
            if any(part.sample for part in command.parts):
                self._samples = self._samples[1], self._clock()
            if isinstance(command, cmd.Jog):
                self._jogged = self._clock() if command.rates.any() else -cmd.JOG_TIME
            self.recorder.command(command, granted)
            return ticket

    def _checked(self, command: cmd.Command, actor: Actor) -> Actor:
        """Return ``actor`` with the grounds for ``command``. Raises LeaseError without any."""
        if not all(part.traits.while_stopped for part in command.parts):
            self.check_runs()
            self._check_settled(actor)
        if any(part.sample for part in command.parts):
            check_in_time(actor.delay, self.sample_delay)
        if actor.channel is CommandChannel.SERVER and not command.traits.protective:
            raise LeaseError("The server itself may not move the arm.")
        if _moves_by_hand(command, actor):
            self._take_over(command, actor)
        return self._granted(actor, pacing=all(part.traits.pacing for part in command.parts))

    def claim(self, actor: Actor, *, of_arm: bool = False) -> Actor:
        """Return ``actor`` with the grounds on which it may command now; send no command.

        A gesture without a command, such as grabbing a handle, uses this. Raises, and acquires a
        free lease, as ``submit`` does. ``of_arm``: whether the gesture is at a control of the arm,
        whose first command takes over from the program of ``actor``, or from a client.
        """
        with self.lock:
            try:
                self.check_runs()
                self._check_settled(actor)
                if of_arm and self._suspends(actor):
                    self.check_current(actor)
                    return replace(actor, grounds=Grounds.PROGRAM_OWNER)
                return self._granted(actor, pacing=of_arm)
            except LeaseError as error:
                self.recorder.refuse("gesture", actor, error)
                raise

    def check_runs(self) -> ArmHandle:
        """Return the arm. Raises LeaseError while it is missing or stopped."""
        arm = self.present()
        self.check_not_stopped()
        return arm

    def check_not_stopped(self) -> None:
        """Raise LeaseError while the arm is stopped."""
        if self.stopped is not None:
            raise LeaseError("The arm is stopped: clear the stop first.")

    def check_current(self, actor: Actor) -> None:
        """Raise LeaseError for a gesture that is older than a stop or a loss of the lease."""
        if not self.is_current(actor):
            raise LeaseError(
                "After you began this, the arm was stopped or the driver changed. Do it again."
            )

    def is_current(self, actor: Actor) -> bool:
        """Return whether there was neither a stop nor a loss of the lease since ``actor`` began."""
        return actor.seen is None or actor.seen == self.revocations

    def present(self) -> ArmHandle:
        """Return the arm. Raises LeaseError until it is ready."""
        if self.arm is None:
            raise LeaseError("The arm is not ready yet.")
        return self.arm

    # Lease

    def acquire(self, actor: Actor) -> None:
        """Acquire the free lease for ``actor``. Raises LeaseError if another person holds it."""
        with self.lock:
            before = self.lease
            lease = before.acquire(actor.person, self._clock())
            if before.holder is not None:
                # That holder has closed its window.
                self._revoke()
            self._hold_lease(lease)
            self.ended = None
            self.recorder.lease("acquired", before, lease, actor)

    def change(
        self,
        event: Callable[[Lease, float], Lease],
        by: Actor = SERVER,
        act: str = "",
        *,
        holds: bool = True,
    ) -> None:
        """Apply ``event`` to the lease at the present time. A change of holder holds the arm.

        ``by``: actor in whose name the arm holds. ``act``: word for ``event`` in the event log;
        empty for what is not recorded. ``holds``: False to let the arm finish its motion. Raises
        the LeaseError of ``event``.
        """
        with self.lock:
            lease = event(self.lease, self._clock())
            if lease.holder != self.lease.holder:
                self._revoke()
                if self.arm is not None and holds:
                    # InputError: the mailbox is full, or the arm's process does not answer.
                    with suppress(InputError):
                        grounds = Grounds.SERVER if by is SERVER else Grounds.LEASE
                        self.arm.deliver(cmd.Hold(), replace(by, grounds=grounds))
            if act and lease is not self.lease:
                self.recorder.lease(act, self.lease, lease, by)
            self._hold_lease(lease)
            self.ended = self.ended if lease.holder is None else None

    # Stop

    def protect(self, why: str) -> None:
        """Stop the arm in the name of the server, for the reason ``why``."""
        with self.lock:
            self._stop(StopCause(why, at=time.time()), SERVER)

    def may_clear(self, person: Person) -> bool:
        """Return whether ``person`` may clear a stop, once that is possible."""
        return person.role.may_drive and self.lease.driver in (None, person)

    @property
    def clear_refusal(self) -> str:
        """Reason for which nobody can clear the present stop yet; empty if it can be cleared."""
        stopped, arm = self.stopped, self.arm
        if arm is None:
            return ""
        if stopped is not None and not stopped.seen(arm.snapshot).confirmed:
            return "The arm has not answered the stop yet: it is not confirmed."
        return arm.clear_refusal

    def pause(self, cause: Finding) -> None:
        """Pause the arm in the name of the server: the next command moves it."""
        with self.lock:
            arm = self.present()
            log.warning("Paused: %s.", finding_text(cause))
            self._waits = True
            self.settle()
            with suppress(InputError):
                arm.deliver(cmd.HoldFor(cause), replace(SERVER, grounds=Grounds.SERVER))

    def settle(self) -> None:
        """Void every gesture, and refuse motion for SETTLE_TIME.

        Messages that waited while a connection or a process hung are not new commands.
        """
        with self.lock:
            self._revoke()
            self.refuse_motion()

    def refuse_motion(self) -> None:
        """Refuse motion for SETTLE_TIME from now on."""
        with self.lock:
            self._settled = self._clock() + SETTLE_TIME

    def _note_pause(self) -> None:
        """Take note of a pause by the process of the arm, which is newer than all gestures."""
        arm = self.arm
        if arm is None:
            return
        if not arm.state.waits:
            self._waits = self._waits and not arm.caught_up
        elif not self._waits:
            causes = [finding for finding in arm.state.findings if finding.reason in CAUSES]
            # Also ends what is being planned for this arm.
            self.pause(causes[0])

    def _check_settled(self, actor: Actor) -> None:
        """Raise LeaseError for a motion just after a pause."""
        self._note_pause()
        if actor.channel is not CommandChannel.SERVER and self._clock() < self._settled:
            raise LeaseError("The arm has just paused. Give the command again.")

    def reconcile(self) -> None:
        """Make gate and arm agree on whether the arm is stopped or paused. Call this often."""
        with self.lock:
            arm = self.arm
            if arm is None:
                return
            self._note_pause()
            snapshot = arm.snapshot
            stopped = snapshot.state.stopped
            if self.stopped is not None and stopped is not None:
                self._note_other(stopped.cause)
            if snapshot.state.presses:
                self._presses.counts(cmd.Stop(others=snapshot.state.presses))
            if self.stopped is not None:
                before, self.stopped = self.stopped, self.stopped.seen(snapshot)
                if stopped is not None and self.stopped.confirmed and not before.confirmed:
                    self._credit(stopped.cause)
                sent = self.stopped.ticket
                if sent is None or (stopped is None and snapshot.ticket >= sent):
                    # The arm started after the stop, or an error undid the stop.
                    again = cmd.Stop(replace(self.stopped.cause, press=""))
                    ticket = arm.deliver(again, replace(SERVER, grounds=Grounds.SERVER))
                    self.stopped = self.stopped.requested(ticket)
            elif stopped is not None and snapshot.ticket >= self._cleared:
                # By the process of STOP, or by the arm's process itself.
                self._adopt(stopped.cause, arm)

    def moves(self) -> bool:
        """Return whether the arm moves or is about to move."""
        with self.lock:
            jogged = self._clock() - self._jogged < cmd.JOG_TIME
            return self.arm is not None and (self.arm.state.moving or jogged)

    def is_known(self, press: str | None) -> bool:
        """Return whether ``press`` of STOP was counted, on any path."""
        known = () if self.arm is None else self.arm.state.presses
        return self._presses.is_known(press) or press in known

    def _press(self, stop: cmd.Stop, actor: Actor) -> int:
        """Stop the arm; return the ticket, which is 0 for a repeated press."""
        cause = pressed(actor.name, actor.key, stop.cause.press, time.time())
        # A press that came by another path is in the state, even if its stop was cleared since.
        if self.is_known(cause.press) or not self._presses.counts(stop):
            self._name(cause, actor)
            return 0
        return self._stop(cause, actor)

    def _name(self, cause: StopCause, actor: Actor) -> None:
        """Let a copy of the press name its presser, a page that was not known before."""
        if self.arm is not None and self.stopped and self.stopped.cause.lacks_name_of(cause):
            self.stopped = replace(self.stopped, cause=replace(cause, at=self.stopped.cause.at))
            self.arm.deliver(cmd.Stop(cause), actor)

    def _stop(self, cause: StopCause, actor: Actor) -> int:
        self._end_gestures()
        actor = replace(actor, grounds=Grounds.SERVER if actor is SERVER else Grounds.SAFETY)
        self.recorder.stop(cause.why, actor, first=self.stopped is None)
        if self.stopped is None:
            self.stopped = StopRecord(cause)
            log.warning("Stopped: %s", cause.why)
        if self.arm is None:
            return 0
        self.stopped = self.stopped.requested(self.arm.deliver(cmd.Stop(cause), actor))
        return self.stopped.ticket or 0

    def _end_gestures(self) -> None:
        """Void what was received and planned before a stop."""
        self._revoke()
        self.on_stop()

    def _adopt(self, cause: StopCause, arm: ArmHandle) -> None:
        """Record a stop that the arm has executed and this gate has not sent."""
        self._end_gestures()
        named, actor = self._named(cause)
        log.warning("Stopped: %s", named.why)
        self.recorder.stop(named.why, actor, first=True)
        # Sent too: it ends what this process plans, and names the press that the arm knows.
        self.stopped = StopRecord(named).requested(arm.deliver(cmd.Stop(named), actor))

    def _note_other(self, cause: StopCause) -> None:
        """Note for the event log a press that stopped the arm and did not pass this gate."""
        if cause.press and not self._presses.is_known(cause.press):
            named, actor = self._named(cause)
            self.recorder.stop(named.why, actor, first=False)

    def _credit(self, cause: StopCause) -> None:
        """Name the person whose STOP was the first that reached the arm, on another path."""
        assert self.stopped is not None
        if cause.by is not None and cause.press != self.stopped.cause.press:
            self.stopped = replace(self.stopped, cause=self._named(cause)[0])
            log.warning("Stopped already: %s", self.stopped.why)

    def _named(self, cause: StopCause) -> tuple[StopCause, Actor]:
        """Return ``cause`` with the display name of its presser, and the presser or the server."""
        presser = self.presser_of(cause)
        if presser is None:
            return cause, replace(SERVER, grounds=Grounds.SERVER)
        return pressed(presser.name, cause.key, cause.press, cause.at), presser

    def _clear_stop(self, actor: Actor) -> tuple[Actor, int]:
        """Clear the stop for ``actor``; return it with its grounds, and the ticket.

        The ticket is 0 while there is no arm.
        """
        # The arm may have been stopped on another path just now.
        self.reconcile()
        if self.may_clear(actor.person) and self.clear_refusal:
            raise LeaseError(self.clear_refusal)
        if self.ended is None or self.ended.owner == actor.key:
            granted = self._granted(actor, pacing=False)
        else:
            # The lease stays free, so that the owner can continue the program.
            self.check_current(actor)
            self.lease.acquire(actor.person, self._clock())
            granted = replace(actor, grounds=Grounds.NO_DRIVER)
        ticket = 0
        if self.arm is not None:
            # A stop that has not come back from the arm yet is not cleared.
            stopped = self.arm.state.stopped
            known = -math.inf if stopped is None else stopped.newest
            ticket = self.arm.deliver(cmd.ClearStop(known), granted)
        self.stopped, self._cleared = None, ticket
        return granted, ticket

    def _revoke(self) -> None:
        """Void every gesture received so far."""
        self.revocations += 1
        self._jogged = -cmd.JOG_TIME

    def _hold_lease(self, lease: Lease) -> None:
        """Set the lease, and note a new holder."""
        if lease.holder != self.lease.holder:
            self.takeover, self._held_since = None, time.time()
            self._samples = -math.inf, -math.inf
        self.lease = lease

    def takeover_by(self, person: Person) -> Takeover | None:
        """Return the takeover by ``person``, who still drives; None without one."""
        takeover = self.takeover
        return takeover if takeover is not None and takeover.by == person.key else None

    def _suspends(self, actor: Actor) -> bool:
        """Return whether ``actor`` takes over by moving the arm that a client of the API drives.

        An admin does so, and a person with the access link of the client, while that streams.
        """
        client, person, (before, newest) = self.lease.driver, actor.person, self._samples
        streams = newest - before < STREAM_GAP and self._clock() - newest < STREAM_TIMEOUT
        if client is None or client == person or not (streams and self.is_client(client)):
            return False
        return person.role.may_take or (client.link != "" and client.link == person.link)

    def _take_over(self, command: cmd.Command, actor: Actor) -> None:
        """Give ``actor`` the lease of its program, which ends, or of a client, which waits.

        No gesture becomes void, because nobody else could drive meanwhile. Raises InputError if the
        arm cannot accept ``command``; the program continues then.
        """
        before, holder, since = self.lease, self.lease.holder, self._held_since
        if holder is None or not (self.program == (holder, actor.key) or self._suspends(actor)):
            return
        self.check_current(actor)
        arm = self.present()
        arm.session.check(command)
        # The path of the program is left in any case, also where its state forbids the command.
        arm.deliver(cmd.Hold(), replace(actor, grounds=Grounds.PROGRAM_OWNER))
        self._hold_lease(before.hand_over(holder, actor.person, self._clock()))
        self.takeover = Takeover(holder, actor.key, arm.state, since)
        self.recorder.lease("taken over", before, self.lease, actor)

    def _granted(self, actor: Actor, *, pacing: bool) -> Actor:
        if actor.channel is CommandChannel.SERVER:
            return replace(actor, grounds=Grounds.SERVER)
        self.check_current(actor)
        holder = self.lease.holder
        if holder == actor.person:
            first = actor.grounds is Grounds.FREE_LEASE
            return actor if first else replace(actor, grounds=Grounds.LEASE)
        if pacing and self.program == (holder, actor.key):
            return replace(actor, grounds=Grounds.PROGRAM_OWNER)
        self.acquire(actor)
        log.info("%s took the free lease (%s).", actor.name, actor.channel.value)
        return replace(actor, grounds=Grounds.FREE_LEASE)


def _moves_by_hand(command: cmd.Command, actor: Actor) -> bool:
    """Return whether ``actor`` moves the arm by ``command`` as a person with a handle or key does.

    The end of a jog, which a page sends whenever it loses a key, and that of a drag move nothing.
    """
    if actor.channel not in (CommandChannel.PAGE, CommandChannel.SCENE):
        return False
    if isinstance(command, cmd.EndDrag) or (isinstance(command, cmd.Jog) and not command.sample):
        return False
    return isinstance(command, cmd.RestoreState) or any(part.traits.goal for part in command.parts)


def guarded(note: Callable[[], None]) -> Callable[[], None]:
    """Return ``note`` with its errors logged and not raised.

    For ``Runner.stopped`` and ``Runner.redirected``, which are on the path of a stop to the arm,
    and for callbacks after a command was delivered, which nothing can take back.
    """

    def noted() -> None:
        try:
            note()
        except Exception:
            log.exception("Error in a callback on the path of commands and stops.")

    return noted
