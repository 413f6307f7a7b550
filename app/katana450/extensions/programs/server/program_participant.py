"""The participant as which a program holds the lease, and the owner of the program."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import SERVER, CommandChannel, Person, Role
from katana450.arm.control.state.modes import Idle
from katana450.arm.control.state.state import State
from katana450.errors import InputError, LeaseError
from katana450.server.service.command_gate import SETTLE_TIME, RunningProgram
from katana450.server.service.heartbeats import LastHeartbeat
from katana450.server.service.hub import Hub
from katana450.server.service.identity import Identity
from katana450.server.service.participants import Participant

log = logging.getLogger(__name__)


def program_identity(name: str, owner: Person) -> Identity:
    """Return the identity as which the program ``name`` of ``owner`` joins the hub."""
    return Identity(
        f"program of {owner.key}", name, Role.OPERATOR, link=owner.link, address=owner.address
    )


def check_may_drive(person: Person) -> None:
    """Raise LeaseError if the role of ``person`` allows only to watch."""
    if not person.role.may_drive:
        raise LeaseError("You may watch, not drive.")


class AlwaysAlive(LastHeartbeat):
    """The heartbeat of a program, always up to date because it runs in this thread.

    The heartbeat of the owner is monitored instead.
    """

    @property
    def newest(self) -> float:
        """Present time [s]."""
        return self._clock()


class ProgramOwner:
    """The owner of the present program, its heartbeats and its rights.

    Attributes:
        participant: the owner; None before the first program.
    """

    def __init__(self, hub: Hub, timeout: float) -> None:
        """Begin without an owner. ``timeout`` is the heartbeat timeout of the owner [s]."""
        self.participant: Participant | None = None
        self._hub = hub
        self._timeout = timeout
        self._seen = 0.0

    def change_to(self, participant: Participant, t: float) -> None:
        """Make ``participant`` the owner at the time ``t`` [s]."""
        self.participant, self._seen = participant, t

    @property
    def is_here(self) -> bool:
        """True if the owner is connected."""
        return self._connected is not None

    def is_silent(self, t: float) -> bool:
        """Return whether no heartbeat was received for the heartbeat timeout before ``t`` [s]."""
        connected = self._connected
        if connected is not None:
            self._seen = max(self._seen, connected.heartbeat.newest)
        return t - self._seen > self._timeout

    def is_person(self, person: Person) -> bool:
        """Return whether ``person`` is the owner."""
        return self.participant is not None and self.participant.person.key == person.key

    def check_may_steer(self, person: Person) -> None:
        """Raise LeaseError if ``person`` is not the owner and may not take the lease from it."""
        participant = self.participant
        if participant is not None and not self.is_person(person) and not person.role.may_take:
            raise LeaseError(f"The program belongs to {participant.person.name}.")

    def superseded_by(self, sender: Participant) -> str:
        """Return why the program that is being planned gives way to a new one of ``sender``.

        Raises LeaseError if it does not: planning may take two minutes, and then blocks all but the
        driver.
        """
        if self.is_silent(self._hub.clock()):
            return "Its owner sends no heartbeats."
        owner, drives = self.participant, self._hub.lease.holder == sender.person
        if owner is None or owner.person == sender.person or not drives:
            raise LeaseError("Another program is being planned. Cancel it, or wait for it.")
        why = f"{sender.person.name}, who drives, has sent another program."
        owner.notify({"is": "refused", "why": f"Your program is not planned any more. {why}"})
        return why

    @property
    def _connected(self) -> Participant | None:
        """The owner as it is connected now; its page may have reloaded."""
        return (
            None if self.participant is None else self._hub.participant(self.participant.person.key)
        )


FollowRun = Callable[[str, str, float, float | None], None]
"""Function of name and text of a script, and the times at which it began and ended [s]."""


class ProgramParticipant:
    """The participant of one run of a program.

    Attributes:
        joined: the participant.
        ticket: ticket of the first command, which drops earlier targets.
        allowed: maximum fraction of full speed that a person has allowed since the run began.
    """

    def __init__(
        self,
        hub: Hub,
        name: str,
        owner: Participant,
        follow_run: Callable[[float, float | None], None],
        left_tool: LeftTool | None = None,
        *,
        holds: bool = True,
    ) -> None:
        """Join ``hub`` as the program ``name`` of ``owner``, and take the lease.

        ``follow_run`` is called with the time at which the run begins [s] and None, and at its end
        with both times. ``left_tool`` is what an earlier run has not restored. ``holds``: whether
        the arm stops first. Raises LeaseError if another participant holds the lease, or the arm is
        stopped.
        """
        self._hub, self._owner = hub, owner
        identity, alive = program_identity(name, owner.person), AlwaysAlive(hub.clock)
        joined = hub.join(identity, "program", lambda _notice: None, alive, CommandChannel.PROGRAM)
        try:
            if hub.lease.holder == owner.person:
                # A handover in one step: no other participant can take the lease in between.
                hub.hand_over(owner, joined.number, holds=holds)
            else:
                hub.gate.acquire(joined.actor)
            # Drops earlier targets; a pause lasts. Raises LeaseError if the arm is stopped.
            hub.gate.check_not_stopped()
            self.ticket = hub.move(joined, cmd.Hold()) if holds else None
        except LeaseError:
            hub.leave(joined, for_good=True)
            raise
        self.joined = joined
        hub.gate.program = RunningProgram(joined.person, owner.person.key)
        # The speed to restore at the end, and the last one that was commanded.
        self._speed = self._commanded = hub.present().state.speed
        self._tool = left_tool.tool if left_tool is not None else hub.present().state.tool
        self.allowed = 1.0
        self._pause_seen: float | None = None
        self._began, self._follow_run = hub.clock(), follow_run
        follow_run(self._began, None)

    @property
    def drives(self) -> bool:
        """True while the program holds the lease."""
        return self._hub.lease.holder == self.joined.person

    @property
    def sets_speed(self) -> bool:
        """True while the speed is another one than a person has chosen."""
        return self._commanded != self._speed

    def follow(self, state: State, t: float) -> None:
        """Keep a speed that a person has set, and end a pause for which only the server was late.

        The speed is kept to the end of the program and after it. ``t`` is the present time [s].
        """
        if state.speed != self._commanded:
            self._speed = self.allowed = self._commanded = state.speed
        if state.pause_cause is None:
            self._pause_seen = None
        elif self._pause_seen is None:
            # What people have ordered meanwhile is read first.
            self._pause_seen = t
        elif t - self._pause_seen > SETTLE_TIME and not state.moving:
            log.info("The program %s continues after a pause.", self.joined.actor.name)
            with suppress(InputError, LeaseError):
                self.send(cmd.Resume())

    def send(self, *commands: cmd.Command) -> int | None:
        """Give ``commands`` to the arm, no faster than allowed; return the ticket of the last."""
        ticket = None
        for command in commands:
            sent = command
            if isinstance(command, cmd.Speed):
                self._commanded = min(command.value, self.allowed)
                sent = cmd.Speed(self._commanded)
            ticket = self._hub.move(self.joined, sent)
        return ticket

    def leave(self) -> LeftTool | None:
        """Restore speed and tool frame, release the lease and leave the hub.

        Returns the tool frame if it could not be restored, as after a stop.
        """
        hub, tool = self._hub, self._tool
        self._follow_run(self._began, hub.clock())
        left = None if hub.present().state.tool == tool else LeftTool(tool, self._owner)
        if self.drives and left is not None:
            with suppress(InputError, LeaseError):
                self.send(cmd.Tool(tool))
                left = None
        stopped = hub.gate.stopped or hub.present().state.stopped
        hub.gate.ended = hub.gate.program if self.drives and stopped is not None else None
        hub.gate.program = None
        with suppress(InputError):
            hub.gate.submit(cmd.Speed(self._speed), SERVER)
        if self.drives:
            hub.release_lease(self.joined)
        hub.leave(self.joined, for_good=True)
        return left


@dataclass(frozen=True)
class LeftTool:
    """The tool frame ``tool`` of before a run of ``owner`` that was stopped."""

    tool: str
    owner: Participant

    def restored(self, hub: Hub) -> LeftTool | None:
        """Select the tool frame once the stop is cleared; return self before that.

        The driver does so, else the owner. A new motion or target keeps the frame that it began in.
        """
        arm, holder = hub.arm, hub.lease.holder
        if hub.stopped is not None or arm is None or not arm.caught_up or arm.state.stopped:
            return self
        participant = self.owner if holder is None else hub.participant(holder.key)
        if participant is not None and isinstance(arm.state.mode, Idle):
            with suppress(InputError, LeaseError):
                hub.move(participant, cmd.Tool(self.tool))
                if holder is None:
                    hub.release_lease(participant)
        return None
