"""Execution of a program on a running server, as a participant of its own that holds the lease.

Planning takes long and runs in a thread (`Planning`); everything else runs in the server's thread.
"""

from __future__ import annotations

import logging
from argparse import Namespace
from contextlib import suppress

from katana450.arm.control import commands as cmd
from katana450.arm.control.actor import SERVER, Actor, CommandChannel
from katana450.arm.control.state import State, Verdict
from katana450.errors import InputError, LeaseError
from katana450.extensions.programs import requests, runner
from katana450.extensions.programs.plan_builder import PlanContext
from katana450.extensions.programs.program import Program
from katana450.extensions.programs.requests import ProgramOrder
from katana450.extensions.programs.runner import Phase, Run
from katana450.extensions.programs.server import state_line
from katana450.extensions.programs.server.program_owner import (
    AlwaysAlive,
    ProgramOwner,
    check_may_drive,
    program_identity,
)
from katana450.extensions.programs.server.program_planning import Planning
from katana450.extensions.programs.server.script_parts import ScriptParts
from katana450.server.api import answers
from katana450.server.api.fields import Request
from katana450.server.service.command_gate import RunningProgram
from katana450.server.service.hub import Hub
from katana450.server.service.last_pause import LastPause
from katana450.server.service.participants import Participant, session_of
from katana450.server.service.runner import Runner, StatusLine

log = logging.getLogger(__name__)


class ProgramRunner(Runner):
    """The runner of at most one program at a time."""

    request_types = (requests.Program, requests.Steer, requests.AllowUnattended)
    controls = ("Script", "Program", "Look at")

    def __init__(self, hub: Hub, options: Namespace) -> None:
        """Prepare to run programs of ``hub``.

        ``options.owner_silence`` is the heartbeat timeout of the owner [s], after which a program
        ends. A page that reloads returns sooner. ``options.no_unattended``: see ``ProgramOwner``.
        """
        super().__init__(hub, options)
        allowed = not options.no_unattended
        self._owner = ProgramOwner(hub, options.owner_silence, may_be_unattended=allowed)
        self._parts = ScriptParts()
        self._planning: Planning | None = None
        self._then: ProgramOrder | None = None
        self._runs_as: Participant | None = None
        self._run: Run | None = None
        # The speed to restore at the end, the maximum that a person allows, and the last command.
        self._speed = self._allowed = self._commanded = 1.0

    @property
    def running(self) -> bool:
        """True while a program holds the arm."""
        return self._runs_as is not None

    @property
    def program(self) -> Program | None:
        """The planned program."""
        return None if self._planning is None else self._planning.program

    @property
    def waits(self) -> bool:
        """True if the program runs as soon as it is planned."""
        return self._then is not None

    def owns(self, participant: Participant) -> bool:
        """Return whether ``participant`` owns the present program."""
        return self._owner.is_person(participant.person)

    def check_may_touch(self, actor: Actor) -> None:
        """Raise LeaseError if ``actor`` may not drive, or does not own the running program."""
        check_may_drive(actor.person)
        if self.running:
            self._owner.check_may_steer(actor.person)

    def handle(self, participant: Participant, request: Request) -> answers.Answer:
        """Execute ``request``. Raises LeaseError or InputError."""
        match request:
            case requests.Program(text=text, more=more, speed=speed):
                self.script(participant, text, more=more, speed=speed)
            case requests.Steer(order=order, unattended=unattended):
                if ticket := self.steer(participant, order, unattended=unattended):
                    return answers.Done(ticket=ticket)
                return answers.Done(outcome=Verdict.ACCEPTED.value)
            case requests.AllowUnattended(allowed=allowed):
                self._owner.allow_unattended(participant.person, allowed=allowed)
        return answers.Done()

    def then(self, order: ProgramOrder | None) -> None:
        """Carry out ``order`` as soon as the present script is planned."""
        self._then = order

    def script(self, participant: Participant, text: str, *, more: bool, speed: float) -> None:
        """Take a part of a script; after the last part, plan it from the present state of the arm.

        The last plan is kept if it is of the same script and nothing has changed since. Raises
        LeaseError while another program runs or is planned, and InputError for too long a script.
        """
        script = self._parts.add(participant.person.key, text, more=more)
        if script is None:
            return
        if self.running:
            raise LeaseError("A program is running. End it first.")
        arm = self.hub.present()
        if arm.state.moving:
            raise LeaseError("The arm is moving. Plan the program when it is at rest.")
        check_may_drive(participant.person)
        before = self._planning
        if before is not None and before.busy:
            before.cancel(self._owner.superseded_by(participant))
        if before is not None and before.fits(script, speed, arm.state):
            before.refused, before.note = None, ""
            self._own(participant)
            return
        changed = ""
        if before is not None and (before.text, before.speed) == (script, speed) and before.program:
            changed = before.changed_to(arm.state)
        self._plan(participant, script, speed, changed)

    def _plan(self, participant: Participant, text: str, speed: float, changed: str) -> None:
        """Plan ``text`` from the present state; ``changed``: why an earlier plan is void."""
        arm = self.hub.present()
        note = f"Planned again: {changed}." if changed else ""
        context = PlanContext(arm.session, arm.arm.T_base_shoulder)
        self._planning = Planning(text, speed, context, arm.state, self.hub.clock, note)
        self._own(participant)

    def _own(self, participant: Participant) -> None:
        self._run = self._then = None
        self._owner.change_to(participant, self.hub.clock())

    def steer(
        self, participant: Participant, order: ProgramOrder, *, unattended: bool = False
    ) -> int | None:
        """Run, step, pause, resume or end the program. Raises LeaseError if it is refused.

        During planning, RUN and STEP take effect at its end, PAUSE and RESUME decide whether the
        program then starts paused, and END cancels the planning.

        Returns the ticket of the command that the arm was given now; None for none.
        """
        check_may_drive(participant.person)
        begins = order in (ProgramOrder.RUN, ProgramOrder.STEP) and not self.running
        if unattended and not begins:
            raise LeaseError("Only `run` and `step` begin an unattended program.")
        self._owner.check_unattended(unattended=unattended)
        planning = self._planning
        if planning is not None and planning.busy:
            self._owner.check_may_steer(participant.person)
            ticket = self._steer_planning(planning, participant, order)
            self._owner.unattended = self._owner.unattended or unattended
            return ticket
        if begins:
            return self._begin(participant, order, unattended=unattended)
        if not self.running or self._run is None:
            raise LeaseError("No program is running.")
        self._owner.check_may_steer(participant.person)
        self.hub.recorder.note("program", participant.actor, {"order": order.value})
        match order:
            case ProgramOrder.RUN | ProgramOrder.RESUME:
                return self._send(cmd.Resume())
            case ProgramOrder.STEP:
                self._run, commands = runner.stepping(self._run)
                return self._send(*commands)
            case ProgramOrder.PAUSE:
                paused = self.hub.present().state.paused
                ticket = self._send(cmd.Pause())
                if not paused:
                    self.hub.gate.last_pause = LastPause.by(participant.actor)
                return ticket
            case ProgramOrder.END:
                return self._end(f"{participant.person.name} ended it.")

    def _steer_planning(
        self, planning: Planning, participant: Participant, order: ProgramOrder
    ) -> int | None:
        match order:
            case ProgramOrder.RUN | ProgramOrder.STEP:
                self.hub.gate.check_not_stopped()
                self._then, planning.note = order, ""
            case ProgramOrder.PAUSE:
                return self.hub.move(participant, cmd.Pause())
            case ProgramOrder.RESUME:
                return self.hub.move(participant, cmd.Resume())
            case ProgramOrder.END:
                self._then = None
                planning.cancel(f"{participant.person.name} cancelled the planning.")
        return None

    def stopped(self) -> None:
        """Cancel a run that waits for its planning, after STOP."""
        self._forget_run("STOP was pressed during planning")

    def redirected(self) -> None:
        """Cancel a run that waits for its planning, after another command to the arm."""
        self._forget_run("the arm was given another command during planning")

    def _forget_run(self, why: str) -> None:
        planning = self._planning
        if self._then is not None and planning is not None:
            self._then, planning.note = None, f"Not run: {why}."

    def leave(self, participant: Participant) -> None:
        """Forget ``participant``; end its program, or the run that waits for its planning."""
        self._parts.forget(participant.person.key)
        if not self.owns(participant):
            return
        self._forget_run(f"{participant.person.name} left")
        if self.running and not self._owner.unattended:
            self._end(f"{participant.person.name} left.")

    def removed(self, session: str) -> None:
        """End the program of the person of ``session``, even if it runs unattended."""
        owner = self._owner.participant
        if owner is not None and session_of(owner.person.key) == session:
            self._owner.unattended = False
            self.leave(owner)

    def tick(self) -> None:
        """Advance the running program by one step, or end it if owner, lease or stop demand it."""
        hub, t = self.hub, self.hub.clock()
        if self._then is not None and self._owner.is_silent(t):
            self._forget_run("its owner sends no heartbeats")
        if self.program is not None and self._then is not None:
            self._start_planned()
        program = self.program
        if self._runs_as is None or self._run is None or program is None:
            return
        if hub.lease.holder != self._runs_as.person:
            # The next holder takes over an arm at rest, so no command is needed.
            self._leave_with(Phase.STOPPED, "The lease was taken from the program.")
            return
        owner = self._owner.participant
        if (why := hub.halted) is not None:
            self._leave_with(Phase.STOPPED, why)
            return
        if owner is not None and self._owner.is_missing(t):
            why = "sends no heartbeats" if self._owner.is_here else "left"
            self._end(f"{owner.person.name} {why}. A program ends without its owner.")
            return
        arm = hub.arm
        if arm is not None and arm.caught_up:
            if arm.state.speed != self._commanded:
                # A speed set by a person applies to the end of the program and after it.
                self._speed = self._allowed = self._commanded = arm.state.speed
            self._run, commands = runner.step(program, self._run, arm.state, t)
            try:
                self._send(*commands)
            except InputError as error:
                self._leave_with(Phase.FAILED, str(error))
                return
            if self._run.phase is not Phase.RUNNING:
                self._leave_with(self._run.phase, self._run.why)

    def progress(self) -> answers.Progress | None:
        """Return the progress of the present or last program; None if there was none."""
        planning, owner = self._planning, self._owner.participant
        if planning is None or owner is None:
            return None
        program, run, arm = planning.program, self._run, self.hub.arm
        if program is None or run is None or arm is None or planning.refused is not None:
            return planning.progress(owner.person.name)
        now, began = runner.progress(program, run, arm.state), self._owner.began
        return answers.Progress(
            name=program.name,
            by=owner.person.name,
            status=now.status,
            step=now.step,
            steps=now.steps,
            line=now.line,
            task=now.name,
            fraction=now.fraction,
            seconds=program.duration,
            seconds_left=runner.seconds_left(program, run, arm.state, self._allowed),
            why=now.why,
            unattended=self._owner.unattended and self.running,
            began=None if began is None else began.isoformat(timespec="seconds"),
        )

    def status_line(self, state: State, line: StatusLine) -> StatusLine:
        """Return the line for the program in place of ``line``."""
        return state_line.status_line(state, line, self.progress(), waits=self.waits)

    def orders(self, participant: Participant) -> tuple[str, ...]:
        """Return the orders that the page of ``participant`` offers; none if not the owner."""
        return state_line.orders(self.progress()) if self.owns(participant) else ()

    def _start_planned(self) -> None:
        """Carry out the order that waits for the end of the planning."""
        then, self._then = self._then, None
        owner = self._owner.participant
        if then is None or owner is None:  # It was cancelled meanwhile.
            return
        try:
            self.steer(owner, then, unattended=self._owner.unattended)
        except LeaseError as error:
            assert self._planning is not None
            self._planning.refused = str(error)

    def _begin(
        self, participant: Participant, order: ProgramOrder, *, unattended: bool
    ) -> int | None:
        """Run the planned program. If the situation has changed, plan it again first."""
        planning, hub = self._planning, self.hub
        if planning is None or planning.program is None:
            raise LeaseError("No program is planned. Send a script first.")
        arm = hub.present()
        changed = planning.changed_to(arm.state)
        if changed:
            self.hub.gate.check_not_stopped()
            if arm.state.moving:
                raise LeaseError("The arm is moving. Plan the program when it is at rest.")
            if hub.lease.holder != participant.person:
                # Otherwise a refusal would come only at the end of the planning, which takes long.
                hub.lease.acquire(participant.person, hub.clock())
            self._plan(participant, planning.text, planning.speed, changed)
            self._then, self._owner.unattended = order, unattended
            return None
        planning.refused, planning.note = None, ""
        program = planning.program
        identity = program_identity(program.name, participant.person)
        alive = AlwaysAlive(hub.clock)
        joined = hub.join(identity, "program", lambda _notice: None, alive, CommandChannel.PROGRAM)
        try:
            if hub.lease.holder == participant.person:
                # A handover in one step: no other participant can take the lease in between.
                hub.hand_over(participant, joined.number)
            else:
                hub.acquire(joined)
            # Drops earlier targets; a pause lasts. Raises LeaseError if the arm is stopped.
            ticket = hub.move(joined, cmd.Hold())
        except LeaseError:
            hub.leave(joined, for_good=True)
            raise
        began = hub.clock()
        self._runs_as = joined
        self._owner.begin(participant, began, unattended=unattended)
        hub.gate.program = RunningProgram(joined.person, participant.person.key)
        self._speed = self._commanded = arm.state.speed
        self._allowed = 1.0
        self._run = Run(began, single=order is ProgramOrder.STEP)
        how = "runs unattended" if unattended else "runs"
        log.info("%s %s the program %s.", participant.person.name, how, program.name)
        what = {"program": program.name, "order": order.value, "unattended": unattended}
        hub.recorder.note("program", participant.actor, what)
        return ticket

    def _send(self, *commands: cmd.Command) -> int | None:
        """Give ``commands`` to the arm; return the ticket of the last."""
        assert self._runs_as is not None
        ticket = None
        for command in commands:
            ticket = self.hub.move(self._runs_as, self._as_allowed(command))
        return ticket

    def _as_allowed(self, command: cmd.Command) -> cmd.Command:
        """Return ``command``, no faster than a person has allowed since the program began."""
        if not isinstance(command, cmd.SpeedScale):
            return command
        self._commanded = min(command.value, self._allowed)
        return cmd.SpeedScale(self._commanded)

    def _end(self, why: str) -> int | None:
        assert self._run is not None
        self._run, commands = runner.stopped(self._run, why)
        ticket = None
        # An arm that is stopped or does not answer accepts no commands.
        with suppress(LeaseError, InputError):
            ticket = self._send(*commands)
        self._leave_with(Phase.STOPPED, why)
        return ticket

    def _leave_with(self, phase: Phase, why: str) -> None:
        """End the run and release the lease; the arm is at rest or comes to rest."""
        assert self._runs_as is not None
        assert self._run is not None
        joined, self._runs_as = self._runs_as, None
        self.hub.gate.program = None
        self._run = runner.ended(self._run, phase, why)
        # The speed of a program does not outlast it.
        with suppress(InputError):
            self.hub.gate.submit(cmd.SpeedScale(self._speed), SERVER)
        if self.hub.lease.holder == joined.person:
            self.hub.release_lease(joined)
        self.hub.leave(joined, for_good=True)
        log.info("The program %s: %s", joined.person.name, why or f"{phase.value}.")
        self.hub.recorder.note("program", joined.actor, {"ended": phase.value}, why=why)
