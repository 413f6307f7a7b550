"""Planning of a script in a thread of its own, and its result."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from enum import Enum

from katana450.arm.control.state import State
from katana450.errors import CancelledError, KatanaError
from katana450.extensions.programs.run.compiler import PlanningStage
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Run
from katana450.extensions.programs.run.situation import Situation
from katana450.maths.planning.checkpoint import checked_by
from katana450.server.api import answers

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
        if self.cancelled is not None or self.refused is not None:
            stage = PlanningPhase.REFUSED if self.cancelled is None else PlanningPhase.CANCELLED
            why = self.cancelled or self.refused or ""
            return answers.Progress(name=self.name, by=by, status=stage.value, why=why)
        if program is None:
            return answers.Progress(
                name=self.name,
                by=by,
                status=PlanningPhase.PLANNING.value,
                step=0 if now is None else now.step,
                steps=0 if now is None else now.steps,
                task="" if now is None else now.phase,
                fraction=0.0 if now is None else now.fraction,
                why=self.note,
            )
        return answers.Progress(
            name=program.name,
            by=by,
            status=PlanningPhase.READY.value,
            steps=program.steps,
            seconds=program.duration,
            why=self.note or " ".join(program.notes),
        )

    def report(self, stage: PlanningStage) -> None:
        """Show ``stage``, which begins."""
        self.stage = stage

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
            at = "" if self.stage is None else f" (at step {self.stage.step})"
            raise CancelledError(
                f"Planning takes longer than {MAX_PLANNING_TIME:g} s{at}. Make the script shorter."
            )
