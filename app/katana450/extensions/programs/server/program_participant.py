"""The participant as which a program holds the lease, and the speed that it may use."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import SERVER, CommandChannel
from katana450.arm.control.modes import Idle
from katana450.arm.control.state import State
from katana450.errors import InputError, LeaseError
from katana450.extensions.programs.server.program_owner import AlwaysAlive, program_identity
from katana450.server.service.command_gate import SETTLE_TIME, RunningProgram
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant

log = logging.getLogger(__name__)

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
    ) -> None:
        """Join ``hub`` as the program ``name`` of ``owner``, and take the lease.

        ``follow_run`` is called with the time at which the run begins [s] and None, and at its end
        with both times. Raises LeaseError if another participant holds the lease, or the arm is
        stopped.
        """
        self._hub, self._owner = hub, owner
        identity, alive = program_identity(name, owner.person), AlwaysAlive(hub.clock)
        joined = hub.join(identity, "program", lambda _notice: None, alive, CommandChannel.PROGRAM)
        try:
            if hub.lease.holder == owner.person:
                # A handover in one step: no other participant can take the lease in between.
                hub.hand_over(owner, joined.number)
            else:
                hub.acquire(joined)
            # Drops earlier targets; a pause lasts. Raises LeaseError if the arm is stopped.
            self.ticket = hub.move(joined, cmd.Hold())
        except LeaseError:
            hub.leave(joined, for_good=True)
            raise
        self.joined = joined
        hub.gate.program = RunningProgram(joined.person, owner.person.key)
        # The speed to restore at the end, and the last one that was commanded.
        self._speed = self._commanded = hub.present().state.speed
        self._tool = hub.present().state.tool
        self.allowed = 1.0
        self._pause_seen: float | None = None
        self._began, self._follow_run = hub.clock(), follow_run
        follow_run(self._began, None)

    @property
    def drives(self) -> bool:
        """True while the program holds the lease."""
        return self._hub.lease.holder == self.joined.person

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
