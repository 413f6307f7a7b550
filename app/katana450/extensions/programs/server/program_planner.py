"""Planning of the present script in a thread, and the order that waits for its end."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterable
from enum import Enum
from functools import partial

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.errors import CancelledError, InputError, KatanaError, LeaseError
from katana450.extensions.programs.building.plan_state import PlanContext
from katana450.extensions.programs.language.source import MAX_BYTES
from katana450.extensions.programs.run.compiler import PlanningStage
from katana450.extensions.programs.run.continuation import Interruption, continued
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.runner import Run
from katana450.extensions.programs.run.situation import Situation
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.server.program_participant import ProgramOwner, check_may_drive
from katana450.maths.planning.checkpoint import checked_by
from katana450.server.api import answers
from katana450.server.api.program_requests import ProgramOrder
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant

log = logging.getLogger(__name__)

MAX_PLANNING_TIME = 120.0
"""[s] Maximum duration of the planning."""


class PlanningPhase(Enum):
    """The phase of a program that has not begun."""

    PLANNING = "planning"
    REFUSED = "refused"
    CANCELLED = "cancelled"
    READY = "ready"


class Planning:
    """The planning of one script with one speed, from one situation of the arm.

    Attributes:
        text: the script.
        speed: fraction of the script's own speed.
        situation: the situation that it is planned for.
        first_step: index of the step with which the program begins.
        continues: the run that it continues; None for a new one.
        name: name of the script; empty until it is parsed.
        stage: present stage of the planning; None before the first step.
        refused: reason why the program cannot run, else None.
        cancelled: reason why the planning was cancelled, else None.
        note: note for people: why it was planned again, or not run.
    """

    def __init__(
        self,
        text: str,
        speed: float,
        state: State,
        job: Callable[[Planning], Program],
        clock: Callable[[], float],
        note: str = "",
        *,
        first_step: int = 0,
        continues: Run | None = None,
    ) -> None:
        """Start the thread, in which ``job`` plans from ``state``. ``clock`` returns the time [s].

        ``job`` reports its progress to the planning, and sets its name.
        """
        self.text = text
        self.speed = speed
        self.situation = Situation.of(state)
        self.first_step = first_step
        self.continues = continues
        self.name = ""
        self.stage: PlanningStage | None = None
        self.refused: str | None = None
        self.cancelled: str | None = None
        self.note = note
        self._clock = clock
        self._began = clock()
        self._program: Program | None = None
        self.thread = threading.Thread(target=self._plan, args=(job,), name="planner", daemon=True)
        self.thread.start()

    @property
    def busy(self) -> bool:
        """True while the planning is in progress."""
        return self._program is None and self.refused is None and self.cancelled is None

    @property
    def program(self) -> Program | None:
        """The planned program; None before the end of the planning, or without success."""
        return None if self.cancelled is not None else self._program

    @property
    def whole(self) -> bool:
        """True if the program begins at the first step of the script."""
        return not self.first_step and self.continues is None

    def cancel(self, why: str) -> None:
        """Cancel the planning. The thread ends at its next checkpoint, some milliseconds later."""
        if self.busy:
            self.cancelled = why
        else:
            self.note = f"Not run: {why}"

    def fits(self, text: str, speed: float, state: State) -> bool:
        """Return whether planning ``text`` at ``speed`` from ``state`` would give this program."""
        same = self.program is not None and (self.text, self.speed) == (text, speed) and self.whole
        return same and not self.changed_to(state)

    def changed_to(self, state: State) -> str:
        """Return a clause that names what has changed since the planning, else "" for nothing."""
        return self.situation.changed_to(Situation.of(state))

    def progress(self, by: str) -> answers.Progress:
        """Return the progress of a program that has not begun. ``by`` is its owner's name."""
        program, now = self.program, self.stage
        progress = partial(answers.Progress, name=self.name, by=by)
        if self.cancelled is not None:
            return progress(status=PlanningPhase.CANCELLED.value, why=self.cancelled)
        if self.refused is not None:
            return progress(status=PlanningPhase.REFUSED.value, why=self.refused)
        if program is not None:
            why = self.note or " ".join(program.notes)
            status, steps, seconds = PlanningPhase.READY.value, program.steps, program.duration
            return progress(status=status, steps=steps, seconds=seconds, why=why)
        planning = partial(progress, status=PlanningPhase.PLANNING.value, why=self.note)
        if now is None:
            return planning()
        return planning(step=now.step, steps=now.steps, task=now.phase, fraction=now.fraction)

    def _plan(self, job: Callable[[Planning], Program]) -> None:
        try:
            with checked_by(self._check):
                self._program = job(self)
        except CancelledError as error:
            if self.cancelled is None:
                self.refused = str(error)
        except KatanaError as error:
            self.refused = str(error)
        except Exception:
            log.exception("Planning failed with an internal error.")
            self.refused = "Planning failed with an internal error. See the server's log."

    def _check(self) -> None:
        if self.cancelled is not None:
            raise CancelledError(self.cancelled)
        if self._clock() - self._began > MAX_PLANNING_TIME:
            step = "" if self.stage is None else f" (at step {self.stage.step})"
            raise CancelledError(
                f"Planning takes longer than {MAX_PLANNING_TIME:g} s{step}. "
                "Make the script shorter."
            )


PLANNED_ORDERS = (ProgramOrder.RUN, ProgramOrder.STEP, ProgramOrder.CONTINUE)
"""The orders that need a planned program."""


class ProgramPlanner:
    """The planner of at most one script at a time, for its owner.

    Attributes:
        planning: the last planning; None before the first script.
        then: the order that is carried out as soon as the planning has succeeded; None for none.
        parts: the parts of the incomplete script of each sender, by the key of the person.
    """

    def __init__(self, hub: Hub, owner: ProgramOwner) -> None:
        """Prepare to plan for the arm of ``hub``."""
        self.planning: Planning | None = None
        self.then: ProgramOrder | None = None
        self._hub = hub
        self._owner = owner
        self.parts: dict[str, str] = {}
        # Name of the script that the breakpoints belong to, and the indices of their steps.
        self._breakpoints: tuple[str, frozenset[int]] = "", frozenset()

    @property
    def program(self) -> Program | None:
        """The planned program."""
        return None if self.planning is None else self.planning.program

    def is_void(self, state: State) -> bool:
        """Return whether the planning failed in another situation than that of ``state``."""
        planning = self.planning
        has_failed = planning is not None and planning.refused is not None and not planning.program
        return has_failed and planning is not None and bool(planning.changed_to(state))

    @property
    def text(self) -> str:
        """The script that was planned last; "" before the first one."""
        return "" if self.planning is None else self.planning.text

    def script(self, participant: Participant, text: str, *, more: bool, speed: float) -> bool:
        """Take a part of a script; after the last part, plan it from the present state of the arm.

        The last plan is kept if it is of the same script and nothing has changed since. Returns
        whether the script is complete. Raises LeaseError if ``participant`` may only watch, or
        while another program is planned, and InputError for too long a script.
        """
        check_may_drive(participant.person)
        script = self.parts.pop(participant.person.key, "") + text
        if len(script.encode()) > MAX_BYTES:
            raise InputError(f"A script has at most {MAX_BYTES // 1024} KB.")
        if more:
            self.parts[participant.person.key] = script
            return False
        arm = self._hub.present()
        self.check_at_rest()
        before = self.planning
        if not self._owner.is_person(participant.person):
            self._breakpoints = "", frozenset()
        if before is not None and before.busy:
            before.cancel(self._owner.superseded_by(participant))
        if before is not None and before.fits(script, speed, arm.state):
            before.refused, before.note = None, ""
            self._own(participant)
            return True
        changed = ""
        if before is not None and (before.text, before.speed) == (script, speed) and before.program:
            changed = before.changed_to(arm.state)
        self.plan(participant, script, speed, changed)
        return True

    def may_continue(self, interruption: Interruption | None) -> bool:
        """Return whether a run was interrupted, and nothing is planned or has changed since."""
        planning, arm = self.planning, self._hub.arm
        if interruption is None or planning is None or planning.busy or arm is None:
            return False
        return not interruption.changed_to(arm.state)

    @property
    def will_run(self) -> bool:
        """True if the program runs as soon as it is planned, and the planning has not failed."""
        planning = self.planning
        ready = planning is not None and (planning.busy or planning.program is not None)
        return self.then is not None and ready

    def require(self) -> Planning:
        """Return the planning of the present program. Raises LeaseError if none is planned."""
        if self.planning is None or self.planning.program is None:
            refused = "" if self.planning is None else self.planning.refused
            raise LeaseError(refused or "No program is planned. Send a script first.")
        return self.planning

    @property
    def breakpoints(self) -> frozenset[int]:
        """Indices of the steps before which the present program pauses."""
        name, steps = self._breakpoints
        same = self.planning is not None and self.planning.name == name
        return steps if same else frozenset()

    def set_breakpoints(self, participant: Participant, steps: Iterable[int]) -> None:
        """Make the present program pause before ``steps``, from 1. Raises LeaseError."""
        if self.planning is None:
            raise LeaseError("There is no program. Send a script first.")
        self._owner.check_may_steer(participant.person)
        self._breakpoints = self.planning.name, frozenset(step - 1 for step in steps)

    def check_free(self, participant: Participant) -> None:
        """Raise LeaseError unless the arm rests, and take the lease for ``participant``.

        Otherwise a refusal would come only at the end of the planning, which takes long.
        """
        self.check_at_rest()
        if self._hub.lease.holder != participant.person:
            self._hub.lease.acquire(participant.person, self._hub.clock())

    def check_at_rest(self) -> None:
        """Raise LeaseError while the arm moves, because plans begin where it stands."""
        if self._hub.present().state.moving:
            raise LeaseError("The arm is moving. Plan the program when it is at rest.")

    def plan(
        self,
        participant: Participant,
        text: str,
        speed: float,
        changed: str = "",
        first_step: int = 0,
    ) -> None:
        """Plan ``text`` from the present state, from the step with index ``first_step``.

        ``speed`` is the fraction of the script's own speed, and ``changed`` a clause on why an
        earlier plan is void.
        """
        note = f"Planned again: {changed}." if changed else ""
        context, state = self._context(), self._hub.present().state

        def job(planning: Planning) -> Program:
            script = parse(text)
            planning.name = script.name
            if script.scene is not None:
                script.scene.check_present(context.session, state)
            report = partial(setattr, planning, "stage")
            return compiled(script, context, state, speed, report, first_step=first_step)

        self.planning = Planning(
            text, speed, state, job, self._hub.clock, note, first_step=first_step
        )
        self._own(participant)

    def plan_rest(
        self, participant: Participant, interruption: Interruption, before: Planning
    ) -> None:
        """Plan the rest of the interrupted program of ``before``.

        Raises LeaseError if something else than the posture of the arm has changed.
        """
        context, state = self._context(), self._hub.present().state
        if changed := interruption.changed_to(state):
            raise LeaseError(f"The program cannot continue: {changed}. Run it again.")

        def job(planning: Planning) -> Program:
            planning.name = interruption.program.name
            return continued(interruption, context, state)

        note = f"It continues at step {interruption.task.number + 1}."
        self.planning = Planning(
            before.text,
            before.speed,
            state,
            job,
            self._hub.clock,
            note,
            continues=interruption.run,
        )
        self._own(participant)

    def steer(self, participant: Participant, order: ProgramOrder) -> int | None:
        """Note or carry out ``order`` while a program is being planned.

        Returns the ticket of the command that the arm was given; None for none.
        """
        planning, hub = self.planning, self._hub
        assert planning is not None
        match order:
            case ProgramOrder.RUN | ProgramOrder.STEP:
                hub.gate.check_not_stopped()
                self.then, planning.note = order, ""
            case ProgramOrder.CONTINUE:
                raise LeaseError("A program is being planned. Cancel it, or wait for it.")
            case ProgramOrder.PAUSE:
                return hub.move(participant, cmd.Pause())
            case ProgramOrder.RESUME:
                return hub.move(participant, cmd.Resume())
            case ProgramOrder.END:
                self.then = None
                planning.cancel(f"{participant.person.name} cancelled the planning.")
        return None

    def forget_run(self, why: str) -> None:
        """Cancel the order that waits for the planning, because of ``why``, a clause."""
        if self.then is not None and self.planning is not None:
            self.then, self.planning.note = None, f"Not run: {why}."

    def _context(self) -> PlanContext:
        arm = self._hub.present()
        return PlanContext(arm.session, arm.arm.T_base_shoulder)

    def _own(self, participant: Participant) -> None:
        self.then = None
        self._owner.change_to(participant, self._hub.clock())
