"""Participants, and the watch over the driver.

Runs in the gateway's one thread; ``CommandGate`` decides which commands reach the arm.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor, CommandChannel, Lease, Person
from katana450.arm.control.session.goals import without_finding
from katana450.arm.control.session.stopping import PAUSE_TIMEOUT, SilenceProfile
from katana450.arm.control.state.findings import entries_between
from katana450.arm.control.state.messages import finding_text, sentence
from katana450.arm.control.state.state import Reason, State
from katana450.arm.control.state.stop_cause import StopCause, pressed
from katana450.arm.robot.object_meshes import Meshes
from katana450.errors import LeaseError
from katana450.server.api.requests import RequestDecoder
from katana450.server.service.arm_handle import ArmHandle
from katana450.server.service.command_gate import CommandGate, StopRecord, guarded
from katana450.server.service.driver_watch import DriverWatch
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.identity import Identity
from katana450.server.service.participants import (
    KnownPages,
    Participant,
    ShownPictures,
    key_of,
    presser_of,
    renamed,
    session_of,
)
from katana450.server.service.recorder import Recorder
from katana450.server.service.runner import RequestHandler, Runner
from katana450.server.service.stop_path import StopPath
from katana450.settings import Settings

log = logging.getLogger(__name__)

TICK = 0.02
"""Interval of the checks for silence [s]."""

CLIENTS = (CommandChannel.WEBSOCKET, CommandChannel.TCP, CommandChannel.HTTP)
"""Channels of clients of the API, such as policies."""


class StopNews:
    """Calls listeners when a stop begins, is confirmed for the first time, or is cleared.

    A repeated press is no news, so that a flood of STOP causes no flood of messages.
    """

    def __init__(self) -> None:
        self.listeners: set[Callable[[], None]] = set()
        """Called without arguments, in the thread of ``note``."""
        self._shown = (False, False)

    def note(self, stopped: StopRecord | None) -> None:
        """Call the listeners if ``stopped``, the present stop, is news."""
        confirmed = stopped is not None and (stopped.confirmed or self._shown[1])
        before, self._shown = self._shown, (stopped is not None, confirmed)
        if self._shown != before:
            for listener in tuple(self.listeners):
                listener()


class Hub:
    """All participants and their heartbeats. Times are in seconds."""

    def __init__(
        self,
        clock: Callable[[], float],
        hold_after: float = Settings.silence,
        meshes: Meshes | None = None,
    ) -> None:
        """Create a hub without participants.

        ``hold_after``: heartbeat timeout of the driver [s] after which a moving arm stops, or
        pauses if it is simulated. ``meshes``: initial meshes.
        """
        self.clock = clock
        self._hold_after = hold_after
        self.gate = CommandGate(clock)
        self.gate.presser_of = self._presser_of
        self.gate.is_client = self._is_client
        self.stop_path, self.stop_news = StopPath(), StopNews()
        self._followed: State | None = None
        self.requires_link = False
        """Whether the server requires access links."""
        self.handlers: list[RequestHandler] = []
        self.use_runner(Runner())
        self.meshes = Meshes() if meshes is None else meshes
        self._participants: dict[str, Participant] = {}
        self.pictures = ShownPictures()
        self._known = KnownPages()
        self._ticked = clock()
        self._driver_watch = DriverWatch(self.gate, self._ticked)
        self.replace_robot: Callable[[Path], None] | None = None
        """Starts the server again with the robot in a file; None where that is not possible."""
        self.shown: dict[str, Any] = {}
        """Entries of extensions in the status of all pages. It is replaced, never changed."""

    def use_runner(self, runner: Runner) -> None:
        """Let ``runner`` drive the arm over time, in place of one that never does."""
        self.runner = runner
        # Before its requests are known: a stop must reach it after every request.
        self.gate.on_stop = guarded(runner.stopped)
        self.add_handler(runner)

    def add_handler(self, handler: RequestHandler) -> None:
        """Let ``handler`` answer its requests."""
        self.handlers.append(handler)
        added = (kind for answerer in self.handlers for kind in answerer.request_types)
        self.requests = RequestDecoder(tuple(added))

    @property
    def held_up(self) -> float:
        """Time since the last tick [s], which is longer than ``TICK`` if the thread hangs."""
        return self.clock() - self._ticked

    @property
    def arm(self) -> ArmHandle | None:
        """The arm; None until it is ready."""
        return self.gate.arm

    @property
    def recorder(self) -> Recorder:
        """Notes events for the event log."""
        return self.gate.recorder

    @property
    def lease(self) -> Lease:
        """The lease, which names the driver."""
        return self.gate.lease

    @property
    def stopped(self) -> StopRecord | None:
        """The present stop; None while the arm is not stopped."""
        stopped, arm = self.gate.stopped, self.gate.arm
        return stopped if stopped is None or arm is None else stopped.seen(arm.snapshot)

    @property
    def halted(self) -> str | None:
        """Reason of the present stop or pause by the server; None without one."""
        arm = self.arm
        if self.stopped is None and arm is not None and arm.caught_up and arm.state.waits:
            return sentence(without_finding(arm.state, Reason.PAUSED))
        return None if self.stopped is None else self.stopped.why

    # Participants

    def join(
        self,
        identity: Identity,
        page: str,
        notify: Callable[[dict[str, Any]], None],
        heartbeat: LastHeartbeat | None = None,
        channel: CommandChannel = CommandChannel.PAGE,
    ) -> Participant:
        """Add a page or program; a page that returns keeps its person and number.

        ``heartbeat``: its newest heartbeat; without one, calls of ``heartbeat`` count. ``channel``:
        channel of its commands.
        """
        key = key_of(identity, page)
        person, number = self._known.recognise(key, identity, self._participants)
        newest = heartbeat or LastHeartbeat(self.clock)
        participant = Participant(person, number, notify, newest, channel)
        self._participants[key] = participant
        self._note_presence("join", participant)
        self.heartbeat(participant)
        return participant

    def rename(self, participant: Participant, name: str) -> None:
        """Give ``participant`` the name ``name``. Raises InputError; see ``renamed``."""
        person = renamed(participant.person, name, self._known.people)
        self.recorder.note("rename", participant.actor, {"name": person.name})
        participant.person = person
        self._known.rename(person, participant.number)
        self.gate.change(lambda lease, _: lease.renamed(person), participant.actor)

    def leave(self, participant: Participant, *, for_good: bool = False) -> None:
        """Remove ``participant``, whose control socket is closed.

        ``for_good``: the participant is a program, which does not return.
        """
        person = participant.person
        if self._participants.get(person.key) is not participant:
            return
        del self._participants[person.key]
        self._note_presence("leave", participant)
        self.gate.change(lambda lease, _: lease.leave(person))
        if not for_good:
            return
        self._known.forget(person.key)
        self.runner.leave(participant)
        if self.lease.holder == person:
            if self.stopped is None and self.gate.moves():
                self.gate.protect(f"{person.name} left while the arm moved.")
            self.release_lease(participant)

    def _note_presence(self, kind: str, participant: Participant) -> None:
        # A program on the server is noted where it begins and ends.
        if participant.channel is not CommandChannel.PROGRAM:
            self.recorder.note(kind, participant.actor, {"number": participant.number})

    def close(self, identity: Identity, page: str) -> None:
        """Free the arm of the page whose window was closed, and brake the arm.

        The page keeps the lease if it returns before another person takes it, as on a reload.
        """
        person = self._known.find(key_of(identity, page))
        if person is not None and self.lease.holder == person:
            if self.stopped is None and self.gate.moves():
                self._driver_watch.brake_left(person)
            self.gate.change(lambda lease, t: lease.close(person, t))

    def present(self) -> ArmHandle:
        """Return the arm. Raises LeaseError until it is ready."""
        return self.gate.present()

    def participant(self, key: str) -> Participant | None:
        """Return the connected participant of ``key``; None if it is not connected."""
        return self._participants.get(key)

    def at_scene(self, key: str, revocations: int, delay: float = 0.0) -> Actor:
        """Return the actor of a gesture at viser's controls. For any thread.

        ``key``: key of the window. ``revocations``: their number when it was received. ``delay``:
        see ``Actor``. Raises LeaseError if the window has no control socket.
        """
        participant = self._participants.get(key)
        if participant is None:
            raise LeaseError("Open the start page to drive the arm.")
        return Actor(participant.person, CommandChannel.SCENE, revocations, delay=delay)

    @property
    def participants(self) -> list[Participant]:
        """All connected participants, the oldest first."""
        return sorted(self._participants.values(), key=lambda participant: participant.number)

    def announce(self, why: str) -> None:
        """Send all participants the reason for which a request is refused. For any thread."""
        for participant in self.participants:
            participant.notify({"is": "refused", "why": why})

    # Requests

    def stop(self, actor: Actor, press: str | None = None) -> int:
        """Stop the arm for ``actor``, which needs no right to drive; return the ticket.

        A repeated ``press`` counts once: it can only add the name, and the ticket is 0.
        """
        return self.gate.submit(cmd.Stop(pressed(actor.name, actor.key, press, 0.0)), actor)

    @property
    def drivers(self) -> tuple[str, ...]:
        """Sessions of the driver, and of the owner of the program that drives."""
        holder, program = self.lease.holder, self.gate.program
        if holder is None:
            return ()
        owner = (program.owner,) if program is not None and program.person == holder else ()
        return tuple(session_of(key) for key in (holder.key, *owner))

    def take(self, participant: Participant) -> None:
        """Take the lease from its holder for ``participant``. Raises LeaseError if not allowed."""
        person, act = participant.person, "taken" if self.lease.driver else "acquired"
        self.gate.change(lambda lease, t: lease.take(person, t), participant.actor, act)

    def release_lease(self, participant: Participant) -> None:
        """Release the lease of ``participant``. Raises LeaseError if another holds it."""
        person = participant.person
        self.gate.change(lambda lease, _: lease.release(person), participant.actor, "released")

    def hand_over(self, participant: Participant, number: int, *, holds: bool = True) -> None:
        """Hand the lease to the participant of ``number``; a running program of the giver ends.

        ``holds``: whether the arm stops, see ``CommandGate.change``.
        """
        giver, taker = self.giver(participant), self._numbered(number).person
        actor = participant.actor
        self.gate.change(
            lambda lease, t: lease.hand_over(giver, taker, t), actor, "handed over", holds=holds
        )

    def decline(self, participant: Participant, number: int) -> None:
        """Decline the request of the participant of ``number`` for the lease, and notify it."""
        giver, requester = self.giver(participant), self._numbered(number)
        person, actor = requester.person, participant.actor
        self.gate.change(lambda lease, _: lease.decline(giver, person), actor)
        why = f"{participant.person.name} declined your request."
        requester.notify({"is": "refused", "why": why})

    def giver(self, participant: Participant) -> Person:
        """Return the person as which ``participant`` hands over: its running program or itself."""
        program = self.gate.program
        owns = program is not None and program.owner == participant.person.key
        return program.person if program is not None and owns else participant.person

    def _numbered(self, number: int) -> Participant:
        participant = next(
            (candidate for candidate in self.participants if candidate.number == number), None
        )
        if participant is None:
            raise LeaseError("That window or program is no longer connected.")
        return participant

    def heartbeat(
        self, participant: Participant, sent: float | None = None, limit: float = math.inf
    ) -> float:
        """Count a message of ``participant`` as a heartbeat; see ``LastHeartbeat.note``."""
        delay = participant.heartbeat.note(sent, limit)
        self._update_lease()
        return delay

    def move(self, participant: Participant, command: cmd.Command, **more: Any) -> int:
        """Submit ``command`` of ``participant``; return its ticket. ``more``: see ``Actor``."""
        return self.gate.submit(command, replace(participant.actor, **more))

    # Watch

    def tick(self, since: float = TICK) -> None:
        """Check that driver and arm are alive. ``since``: interval since the last check [s]."""
        arm = self.arm
        before, self._ticked = self._ticked, self.clock()
        self._driver_watch.note_lateness(self._ticked - before - since, self._ticked)
        self._update_lease()
        silent = self._check_driver(self.clock())
        if arm is not None:
            # Without heartbeats of the server the arm stops by itself.
            if not silent:
                arm.heartbeat()
            self._watch(arm)
            self.follow_stop()
            self.runner.tick()

    def follow_stop(self) -> None:
        """Note the findings, make gate and arm agree on the stop, and spread the news of it."""
        if self.arm is not None:
            before, self._followed = self._followed, self.arm.state
            for entry in (
                () if before is self._followed else entries_between(before, self._followed)
            ):
                self.recorder.note("finding", None, entry)
                if entry.began:
                    log.info("%s", finding_text(entry.finding))
        self.gate.reconcile()
        self.stop_news.note(self.stopped)

    def _update_lease(self) -> None:
        """Renew the lease by the newest heartbeat of the driver, at the time of its receipt."""
        holder = self.lease.holder
        participant = None if holder is None else self._participants.get(holder.key)
        if participant is not None:
            newest = participant.heartbeat.newest
            self.gate.change(lambda lease, _: lease.hear(participant.person, newest))

    def _watch(self, arm: ArmHandle) -> None:
        """Stop an arm whose process does not answer; it stops once the process answers again."""
        age, due = arm.age, self.gate.moves() or not arm.caught_up
        # A simulated arm that answers late pauses by itself.
        strict = arm.profile is SilenceProfile.REAL_ARM
        limit = 2 * self._hold_after if strict else PAUSE_TIMEOUT
        if self.stopped is None and due and age > limit:
            self.gate.protect(f"The arm's process did not answer for {age:.1f} s.")

    def _check_driver(self, t: float) -> bool:
        """Brake a moving arm if the driver is silent or late; return whether it is silent."""
        self._driver_watch.follow(self.lease.holder, self._heard, t)
        holder = self.lease.holder
        if holder is None or self.arm is None:
            return False
        driver, silence = self._participants.get(holder.key), self.lease.silence(t)
        if silence >= self._hold_after and self.stopped is None and self.gate.moves():
            self._driver_watch.brake(holder, silence, t, connected=driver is not None)
        self.gate.change(lambda lease, t: lease.expire(t), act="expired")
        silence -= 0.0 if driver is None else driver.heartbeat.delay
        return silence >= self._hold_after and self.lease.holder is not None

    def _heard(self, person: Person) -> float:
        """Return the time of the newest heartbeat of ``person`` [s]."""
        participant = self._participants.get(person.key)
        return -math.inf if participant is None else participant.heartbeat.newest

    def person_of(self, identity: Identity, page: str) -> Person:
        """Return the person at ``page``, whether or not its control socket is open now."""
        key = key_of(identity, page)
        return self._known.recognise(key, identity, self._participants)[0]

    def _is_client(self, person: Person) -> bool:
        """Return whether ``person`` is a connected client of the API. For any thread."""
        participant = self._participants.get(person.key)
        return participant is not None and participant.channel in CLIENTS

    def _presser_of(self, cause: StopCause) -> Actor | None:
        """Return the participant that pressed STOP on the port of STOP; None for a watchdog."""
        return presser_of(cause, self._known.people, links=self.requires_link)
