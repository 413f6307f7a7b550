"""Execution of a program on a running server, as a participant of its own that holds the lease.

Planning takes long and runs in a thread (`Planning`); everything else runs in the server's thread.
"""

from __future__ import annotations

import logging
from argparse import Namespace
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import msgspec

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.act import Request
from katana450.arm.control.lease import Actor, Person
from katana450.arm.control.state.state import State
from katana450.errors import InputError, LeaseError
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.continuation import Interruption
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.run.situation import Situation
from katana450.extensions.programs.server import page_state
from katana450.extensions.programs.server.page_state import RunNews, planned_steps, steps_of
from katana450.extensions.programs.server.program_participant import (
    FollowRun,
    LeftTool,
    ProgramOwner,
    ProgramParticipant,
    check_may_drive,
)
from katana450.extensions.programs.server.program_planner import (
    PLANNED_ORDERS,
    Planning,
    ProgramPlanner,
)
from katana450.server.api import answers
from katana450.server.api import program_requests as requests
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service.dispatcher import ACCEPTED
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.runner import Runner, StatusLine

log = logging.getLogger(__name__)

MAX_TASKS = 1000
"""Number of tasks of a run after which the arm can be set back."""


class ProgramRunner(Runner):
    """The runner of at most one program at a time."""

    request_types = requests.REQUESTS

    def __init__(self, hub: Hub, options: Namespace) -> None:
        """Prepare to run programs of ``hub``. ``options``: see ``extension.add_serve_options``."""
        self.hub = hub
        self._owner = ProgramOwner(hub, options.owner_silence)
        self.planner = ProgramPlanner(hub, self._owner)
        self._interruption: Interruption | None = None
        self._left_tool: LeftTool | None = None
        # Runs of the present program whose task is new or begins, by the times of their states.
        self._tasks: list[tuple[float, Run]] = []
        # The run at a moment that the arm was set back to, and the number of motions until then.
        self._restored: tuple[Run, int] | None = None
        hub.gate.delivered.append(self._note_restored)
        self._is_news = False  # Whether no other command followed the end of a run or planning.
        self._runs_as: ProgramParticipant | None = None
        self._run: Run | None = None
        # The program whose preview was looked at last, the time [s], and by whom.
        self._looked: tuple[Program | None, float | None, Participant | None] = None, 0.0, None
        self.show_preview: Callable[[], object] = lambda: None
        """Called in the server's thread when ``look_time`` has changed by a request."""
        self.follow_run: FollowRun = lambda *_: None
        """Called with name and text of a script that begins or has ended, and these times [s]."""

    @property
    def running(self) -> bool:
        """True while a program holds the arm."""
        return self._runs_as is not None

    @property
    def sets_speed(self) -> bool:
        """True while a step has set the speed."""
        return self._runs_as is not None and self._runs_as.sets_speed

    @property
    def program(self) -> Program | None:
        """The planned program."""
        return self.planner.program

    @property
    def drawn(self) -> Program | None:
        """The program whose path is drawn; None at rest, if its owner has left or hides it."""
        is_drawn = self.look_time is not None and self._owner.is_here
        return self.program if self.running or is_drawn else None

    @property
    def begun(self) -> bool:
        """True once the present program has begun to run, also after its end."""
        return self._run is not None

    @property
    def waits(self) -> bool:
        """True if the program runs as soon as it is planned."""
        return self.planner.then is not None

    def owns(self, participant: Participant) -> bool:
        """Return whether ``participant`` owns the present program."""
        return self._owner.is_person(participant.person)

    def runs_for(self, participant: Participant) -> bool:
        """Return whether the program of ``participant`` runs, or will once it is planned."""
        return self.owns(participant) and (self.running or self.planner.will_run)

    def handle(self, participant: Participant, request: Request) -> answers.Answer:
        """Execute ``request``. Raises LeaseError or InputError."""
        match request:
            case requests.Program(text=text, more=more, speed=speed):
                self.script(participant, text, more=more, speed=speed)
            case requests.Steer(order=order, at=step):
                ticket = self.steer(participant, order, step)
                return answers.Done(ticket=ticket, outcome=None if ticket else ACCEPTED)
            case requests.Breakpoints(steps=steps):
                self.set_breakpoints(participant, steps)
            case requests.Preview(at=t):
                self._look_at(participant, t)
        return answers.Done()

    def script(self, participant: Participant, text: str, *, more: bool, speed: float) -> None:
        """Take a part of a script, see ``ProgramPlanner.script``.

        Raises LeaseError while another program runs or is planned, and InputError for too long a
        script.
        """
        if not more and self.running:
            raise LeaseError("A program is running. End it first.")
        before = self.planner.text
        if self.planner.script(participant, text, more=more, speed=speed):
            self._run, self._is_news = None, True
            if self.planner.text != before:
                self._interruption = self._restored = None
                self._tasks = []

    def set_breakpoints(self, participant: Participant, steps: Sequence[int]) -> None:
        """Make the present program pause before ``steps``, from 1. Raises LeaseError."""
        self.planner.set_breakpoints(participant, steps)
        if self._run is not None:
            self._run = replace(self._run, pauses=self.planner.breakpoints)

    def steer(
        self, participant: Participant, order: ProgramOrder, step: int | None = None
    ) -> int | None:
        """Carry out ``order`` for the program; see ``requests.Steer``. Raises LeaseError.

        During planning, RUN and STEP take effect at its end, PAUSE and RESUME decide whether the
        program then starts paused, and END cancels the planning.

        Returns the ticket of the command that the arm was given now; None for none.
        """
        check_may_drive(participant.person)
        if order is ProgramOrder.REWIND:
            return self._rewind(participant)
        plans = order is ProgramOrder.CONTINUE or step is not None
        begins = order in PLANNED_ORDERS and (plans or not self.running)
        if step is not None and order not in (ProgramOrder.RUN, ProgramOrder.STEP):
            raise LeaseError("Only `run` and `step` begin at a step.")
        planning = self.planner.planning
        if planning is not None and (planning.busy or self.planner.will_run):
            self._owner.check_may_steer(participant.person)
            if step is not None:
                planning.cancel(f"{participant.person.name} runs it from step {step}.")
                self._plan_part(participant, order, step)
                return None
            return self.planner.steer(participant, order)
        if plans:
            self._plan_part(participant, order, step)
            return None
        if begins:
            return self._begin(participant, order)
        if self._runs_as is None or self._run is None:
            raise LeaseError("No program is running.")
        self._owner.check_may_steer(participant.person)
        self.hub.recorder.note("program", participant.actor, {"order": order.value})
        match order:
            case ProgramOrder.RUN | ProgramOrder.RESUME:
                return self._runs_as.send(cmd.Resume())
            case ProgramOrder.STEP:
                self._run = replace(self._run, single=True)
                return self._runs_as.send(cmd.Resume())
            case ProgramOrder.PAUSE:
                return self._runs_as.send(cmd.Pause())
            case ProgramOrder.END:
                return self._end(f"{participant.person.name} ended it.")
            case ProgramOrder.CONTINUE | ProgramOrder.REWIND:
                raise AssertionError("It was handled above.")

    def stopped(self) -> None:
        """Cancel a run that waits for its planning, after STOP."""
        self.planner.forget_run("STOP was pressed during planning")

    def redirected(self) -> None:
        """Cancel a run that waits for its planning, after another command to the arm."""
        self._is_news = False
        self.planner.forget_run("the arm was given another command during planning")

    def leave(self, participant: Participant) -> None:
        """Forget ``participant``; end its program, or the run that waits for its planning."""
        self.planner.parts.pop(participant.person.key, None)
        self.end(participant, f"{participant.person.name} has left")

    def end(self, participant: Participant, why: str) -> None:
        """End the program of ``participant``, or the run that waits for its planning."""
        if self.owns(participant):
            self.planner.forget_run(why)
            if self.running:
                self._end(f"{why}.")

    def tick(self) -> None:
        """Advance the running program by one step, or end it if owner, lease or stop demand it."""
        hub, t = self.hub, self.hub.clock()
        if self.waits and self._owner.is_silent(t):
            self.planner.forget_run("its owner sends no heartbeats")
        if self._looked[2] not in (None, *hub.participants):
            self._looked = None, 0.0, None
            self.show_preview()
        # A run that is being planned begins in the frame of now, and restores it at its end.
        if self._left_tool is not None and not self.planner.will_run:
            self._left_tool = self._left_tool.restored(hub)
        if self.program is not None and self.waits:
            self._start_planned()
        program = self.program
        if self._runs_as is None or self._run is None or program is None:
            return
        if not self._runs_as.drives:
            self._leave_with(self._left_run(self._run))
            return
        owner = self._owner.participant
        if (why := hub.halted) is not None:
            self._leave_with(runner.ended(self._run, Phase.STOPPED, why))
            return
        if owner is not None and self._owner.is_silent(t):
            why = "sends no heartbeats" if self._owner.is_here else "left"
            self._end(f"{owner.person.name} {why}. A program ends without its owner.")
            return
        arm = hub.arm
        if arm is not None and arm.caught_up:
            self._runs_as.follow(arm.state, t)
            run, commands = runner.step(program, self._run, arm.state, t)
            try:
                self._runs_as.send(*commands)
            except InputError as error:
                run = runner.ended(run, Phase.FAILED, str(error))
            if (run.number, run.started) != (self._run.number, self._run.started):
                self._note_task(run)
            if run.phase is Phase.RUNNING:
                self._run = run
            else:
                self._leave_with(run)

    def progress(self) -> answers.Progress | None:
        """Return the progress of the present or last program; None if there was none."""
        planning, owner, arm = self.planner.planning, self._owner.participant, self.hub.arm
        if planning is None or owner is None:
            return None
        program, run = planning.program, self._run
        if program is None or run is None or arm is None or planning.refused is not None:
            progress = planning.progress(owner.person.name)
        else:
            allowed = 1.0 if self._runs_as is None else self._runs_as.allowed
            progress = runner.progress(program, run, arm.state, owner.person.name, allowed)
        return msgspec.structs.replace(
            progress,
            breakpoints=tuple(sorted(index + 1 for index in self.planner.breakpoints)),
            can_continue=not self.running and self.planner.may_continue(self._interruption),
        )

    def plan(self) -> answers.ProgramPlan:
        """Return the present or last program with its steps."""
        program, progress, look = self.program, self.progress(), self.look_time
        if program is None:
            return answers.ProgramPlan(text=self.planner.text, program=progress, look=look)
        return answers.ProgramPlan(
            text=self.planner.text,
            program=progress,
            steps=planned_steps(steps_of(program), progress, look or 0.0),
            seconds=0.0 if self.begun else program.preview_time,
            look=look,
        )

    @property
    def look_time(self) -> float | None:
        """Time [s] of the preview that the scene shows; 0 for none, None if it is hidden."""
        program, t, _ = self._looked
        if program is not self.program or self.running:
            return 0.0
        return 0.0 if self.begun and t is not None else t

    def _look_at(self, participant: Participant, t: float | None) -> None:
        """Show the time ``t`` [s] of the preview, or hide it. Raises LeaseError without one."""
        check_may_drive(participant.person)
        if self.running:
            raise LeaseError("The program runs, and the arm itself shows it.")
        if t:
            program = self.planner.require().program
            assert program is not None
            if program.preview_time <= 0.0 or self.begun:
                raise LeaseError("There is no preview. Plan the program from its beginning first.")
            t = min(t, program.preview_time)
        else:
            self._owner.check_may_steer(participant.person)
            # The end of a run is still news while another text is edited.
            self._is_news = self._is_news and (t is not None or self.begun)
        self._looked = self.program, t, participant
        self.show_preview()

    def status_line(self, state: State, line: StatusLine, reader: Person | None) -> StatusLine:
        """Return the line for the program in place of ``line``."""
        is_news = self._is_news and not self.planner.is_void(state)
        news = RunNews(self._run, reader) if is_news else None
        return page_state.status_line(state, line, self.progress(), news, waits=self.waits)

    def names(self, person: Person) -> bool:
        """Return whether the line says what ``person`` has done."""
        program = self.progress() if self._is_news else None
        return program is not None and program.why.startswith(person.name)

    def orders(self, participant: Participant) -> tuple[str, ...]:
        """Return the orders that the page of ``participant`` offers; none if not the owner."""
        if not self.owns(participant):
            return ()
        free = self.hub.stopped is None and self.hub.lease.holder in (None, participant.person)
        return page_state.orders(self.progress(), may_begin=free)

    def _start_planned(self) -> None:
        """Carry out the order that waits for the end of the planning."""
        then, self.planner.then = self.planner.then, None
        owner, planning = self._owner.participant, self.planner.planning
        if then is None or owner is None or planning is None:  # It was cancelled meanwhile.
            return
        try:
            if planning.whole:
                self.steer(owner, then)
            elif changed := planning.changed_to(self.hub.present().state):
                raise LeaseError(f"Not run: {changed}.")
            else:
                check_may_drive(owner.person)
                self._start(planning, owner, then)
        except LeaseError as error:
            planning.refused = str(error)

    def _plan_part(self, participant: Participant, order: ProgramOrder, step: int | None) -> None:
        """Plan the program from a step, or from where it ended early, and then run it."""
        planning, interruption = self.planner.planning, self._interruption
        if step is None and (takeover := self.hub.gate.takeover_by(participant.person)):
            self.hub.gate.check_not_stopped()
            if (client := self.hub.participant(takeover.driver.key)) is not None:
                self.hub.hand_over(participant, client.number)
                return
        if step is None and self._restored is not None and planning is not None:
            run, motions = self._restored
            assert planning.program is not None
            untouched = motions == self.hub.gate.motions
            if untouched and runner.follows(planning.program, run, self.hub.present().state):
                self._owner.check_may_steer(participant.person)
                self._start(planning, participant, order, run)
                return
        if planning is None:
            raise LeaseError("No program is planned. Send a script first.")
        if self.running and step is None:
            raise LeaseError("The program is running. `resume` ends a pause.")
        if step is None and interruption is None:
            raise LeaseError("No program was interrupted. Run it from the beginning.")
        self._owner.check_may_steer(participant.person)
        self.hub.gate.check_not_stopped()
        if self.running:
            if self.hub.present().state.moving:
                raise LeaseError("The arm is moving. Pause it first, and choose the step at rest.")
            self._end(f"{participant.person.name} went to step {step}.")
        self.planner.check_free(participant)
        if step is None and interruption is not None:
            self.planner.plan_rest(participant, interruption, planning)
        else:
            self.planner.plan(
                participant, planning.text, planning.speed, first_step=(step or 1) - 1
            )
        self._run, self.planner.then = None, order

    def _left_run(self, run: Run) -> Run:
        """Return how ``run`` ends without the lease, or the run that the arm was set back to."""
        if self._restored is not None:
            return self._restored[0]
        reason, holder = "The lease was taken from the program.", self.hub.lease.holder
        if holder is not None and self._owner.is_person(holder):
            reason = f"{holder.name} took over."
        return runner.ended(run, Phase.STOPPED, reason)

    def _note_task(self, run: Run) -> None:
        """Remember that ``run`` has a new task, begins it or ends."""
        self._tasks = [*self._tasks[1 - MAX_TASKS :], (self.hub.present().state.t, run)]

    def _note_restored(self, command: cmd.Command, _actor: Actor, *_: object) -> None:
        """Offer to continue the program after the arm was set back to a moment in which it ran."""
        program = self.program
        if not isinstance(command, cmd.RestoreState) or program is None or self._run is None:
            return
        self._restored = None
        run = runner.reached(program, self._tasks, command.state)
        if run is not None and command.of_own_run:
            ended = runner.ended(run, Phase.STOPPED, "The arm continues from an earlier moment.")
            self._restored = ended, self.hub.gate.motions
            self._interruption = Interruption(program, ended, Situation.of(command.state))
            if not self.running:
                self._run, self._is_news = ended, True

    def _rewind(self, participant: Participant) -> int:
        """Restore the state in which the owner took over, and hold the arm there."""
        takeover = self.hub.gate.takeover_by(participant.person)
        if takeover is None:
            self._owner.check_may_steer(participant.person)
            raise LeaseError("Nobody has taken over from this program.")
        self.hub.move(participant, cmd.RestoreState(takeover.state))
        return self.hub.move(participant, cmd.Hold())

    def _begin(self, participant: Participant, order: ProgramOrder) -> int | None:
        """Run the planned program. If the situation has changed, plan it again first."""
        planning = self.planner.require()
        changed = planning.changed_to(self.hub.present().state)
        if changed or not planning.whole:
            self.hub.gate.check_not_stopped()
            self.planner.check_free(participant)
            self.planner.plan(participant, planning.text, planning.speed, changed)
            self._run, self.planner.then = None, order
            return None
        return self._start(planning, participant, order)

    def _start(
        self,
        planning: Planning,
        participant: Participant,
        order: ProgramOrder,
        reached: Run | None = None,
    ) -> int | None:
        """Run the program of ``planning``, which fits the present situation.

        ``reached``: the run in which the arm is, on the plan of its task; None for its beginning.
        """
        assert planning.program is not None
        planning.refused, planning.note = None, ""
        program, began = planning.program, self.hub.clock()
        follow = partial(self.follow_run, program.name, planning.text)
        self._runs_as = ProgramParticipant(
            self.hub, program.name, participant, follow, self._left_tool, holds=reached is None
        )
        self._owner.change_to(participant, began)
        self._interruption = self._left_tool = self._restored = None
        begin = replace(planning.continues or Run(began), number=program.first, started=False)
        self._run = replace(
            begin if reached is None else reached,
            t=began,
            phase=Phase.RUNNING,
            why="",
            single=order is ProgramOrder.STEP,
            pauses=self.planner.breakpoints,
        )
        self._tasks = [] if reached is None else self._tasks
        self._note_task(self._run)
        log.info("%s runs the program %s.", participant.person.name, program.name)
        what = {"program": program.name, "order": order.value}
        self.hub.recorder.note("program", participant.actor, what)
        return self._runs_as.ticket

    def _end(self, why: str) -> int | None:
        assert self._run is not None
        assert self._runs_as is not None
        run, commands = runner.stopped(self._run, why)
        ticket = None
        # An arm that is stopped or does not answer accepts no commands.
        with suppress(LeaseError, InputError):
            ticket = self._runs_as.send(*commands)
        self._leave_with(run)
        return ticket

    def _leave_with(self, run: Run) -> None:
        """End with ``run`` and release the lease; the arm is at rest or comes to rest."""
        assert self._runs_as is not None
        if self.program is not None and self._restored is None:
            # Set first, because the progress is read in other threads too.
            self._interruption = Interruption.of(self.program, run, self.hub.present().state)
        self._note_task(run)
        left, self._runs_as, self._run = self._runs_as, None, run
        self._left_tool, self._is_news = left.leave(), True
        actor = left.joined.actor
        log.info("The program %s: %s", actor.name, run.why or run.phase.value)
        self.hub.recorder.note("program", actor, {"ended": run.phase.value}, why=run.why)
