"""A person's program, run where the people are: a participant of its own that holds the arm.

Planning takes long and happens in a thread; all else lives in the gateway's one thread.
"""

from __future__ import annotations

import logging
import threading
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from app.api import answers
from app.api.fields import Order
from app.control import commands as cmd
from app.control.lease import Role
from app.control.state import State
from app.errors import InputError, KatanaError, LeaseError
from app.gateway.door import Visitor
from app.gateway.liveness import Heartbeat
from app.programs import runner
from app.programs.bench import Rig
from app.programs.program import Program, compiled
from app.programs.runner import Phase, Run
from app.programs.script import parse
from app.programs.source import LARGEST

if TYPE_CHECKING:
    from app.gateway.hub import Hub, Window

log = logging.getLogger(__name__)

LONGEST_PLANNING = 120.0
"""[s]"""


class Stage(Enum):
    """How far a program is that does not run."""

    PLANNING = "planning"
    REFUSED = "refused"
    READY = "ready"


@dataclass
class _Planning:
    """What the thread leaves behind."""

    began: float
    program: Program | None = None
    refused: str | None = None
    given_up: bool = False


class _Here(Heartbeat):
    """A program runs in this thread and so is always there; its owner is watched instead."""

    @property
    def newest(self) -> float:
        return self._clock()


class Performer:
    """At most one program at a time."""

    def __init__(self, hub: Hub, owner_silence: float) -> None:
        """``owner_silence``: time without a heartbeat of its owner after which a program ends [s];
        a page that reloads is back sooner."""
        self._hub = hub
        self._owner_silence = owner_silence
        self._parts: dict[str, str] = {}
        self._planning: _Planning | None = None
        self._owner: Window | None = None
        self._hand: Window | None = None
        self._then: Order | None = None
        self._seen = 0.0
        self._self: Window | None = None
        self._run: Run | None = None
        self._speed = 1.0

    @property
    def running(self) -> bool:
        """Whether a program has the arm."""
        return self._self is not None

    @property
    def program(self) -> Program | None:
        """The one that is planned."""
        return None if self._planning is None else self._planning.program

    def touch(self, window: Window) -> None:
        """``window`` touches the panel of programs. Raises LeaseError if it must not."""
        self._check_may_drive(window)
        if self.running:
            self._check_owns(window)
        self._hand = window

    def plan(self, text: str, then: Order | None) -> None:
        """Plan ``text`` for who touched the panel last, and do ``then`` once it is planned."""
        if self._hand is None:
            raise LeaseError("Open the front page to run programs.")
        self.script(self._hand, text, more=False, speed=1.0)
        self._then = then

    def order(self, order: Order) -> None:
        """`steer` for who touched the panel last."""
        if self._hand is None:
            raise LeaseError("Open the front page to run programs.")
        self.steer(self._hand, order)

    def script(self, window: Window, text: str, *, more: bool, speed: float) -> None:
        """A part of a script; after the last it is planned, from where the arm stands then.

        Raises LeaseError while another runs or is planned, InputError for one that is too long.
        """
        key = window.person.key
        text = self._parts.pop(key, "") + text
        if len(text.encode()) > LARGEST:
            raise InputError(f"A script has at most {LARGEST // 1024} KB.")
        if more:
            self._parts[key] = text
            return
        self._check_free()
        arm = self._hub.present()
        if arm.state.moving:
            raise LeaseError("The arm moves: a program is planned from where it stands.")
        self._check_may_drive(window)
        planning = _Planning(self._hub.clock())
        self._planning, self._owner, self._run = planning, window, None
        self._seen, self._then = planning.began, None
        work = (planning, text, speed, arm.rig, arm.state)
        threading.Thread(target=self._plan, args=work, name="planner", daemon=True).start()

    def steer(self, window: Window, order: Order) -> None:
        """Run, step, pause, resume or halt it. Raises LeaseError with the reason why not."""
        self._check_may_drive(window)
        if order in (Order.RUN, Order.STEP) and not self.running:
            self._begin(window, single=order is Order.STEP)
            return
        if not self.running or self._run is None:
            raise LeaseError("No program runs.")
        self._check_owns(window)
        match order:
            case Order.RUN | Order.RESUME:
                self._tell(cmd.Resume())
            case Order.STEP:
                self._run, commands = runner.stepping(self._run)
                self._tell(*commands)
            case Order.PAUSE:
                self._tell(cmd.Pause())
            case Order.HALT:
                self._end(f"{window.person.name} ended it.")

    def stopped(self) -> None:
        """The arm was stopped: what was asked for before that is not done after it."""
        self._then = None

    def leave(self, window: Window) -> None:
        """Somebody is gone for good."""
        self._parts.pop(window.person.key, None)
        if self.running and self._owner is window:
            self._end(f"{window.person.name} left.")

    def tick(self) -> None:
        """Look at the arm, and go on; to be called often."""
        program = self.program
        if program is not None and self._then is not None:
            self._go_on()
        if self._self is None or self._run is None or program is None:
            return
        hub, t = self._hub, self._hub.clock()
        owner = self._owner
        window = None if owner is None else hub.window(owner.person.key)
        if window is not None:
            self._seen = max(self._seen, window.heartbeat.newest)
        if hub.lease.holder != self._self.person:
            # The next who holds the arm finds one that stands, so nothing is left to be told.
            self._leave_with(Phase.STOPPED, "The arm was taken from it.")
            return
        if hub.stopped is not None:
            self._leave_with(Phase.STOPPED, hub.stopped.why)
            return
        if owner is not None and t - self._seen > self._owner_silence:
            why = "left" if window is None else "fell silent"
            self._end(f"{owner.person.name} {why}: a program ends with its owner's heartbeats.")
            return
        arm = hub.arm
        if arm is not None and arm.caught_up:
            self._run, commands = runner.step(program, self._run, arm.state, t)
            try:
                self._tell(*commands)
            except InputError as error:
                self._leave_with(Phase.FAILED, str(error))
                return
            if self._run.phase is not Phase.RUNNING:
                self._leave_with(self._run.phase, self._run.why)

    def told(self) -> answers.Progress | None:
        """How it stands; None when there is none."""
        planning, owner = self._planning, self._owner
        if planning is None or owner is None:
            return None
        program = planning.program
        if program is None:
            stage = Stage.PLANNING if planning.refused is None else Stage.REFUSED
            return answers.Progress(
                name="", by=owner.person.name, status=stage.value, why=planning.refused or ""
            )
        if self._run is None or self._hub.arm is None:
            return answers.Progress(
                name=program.name,
                by=owner.person.name,
                status=Stage.READY.value,
                steps=program.steps,
                seconds=program.duration,
            )
        now = runner.progress(program, self._run, self._hub.arm.state)
        return answers.Progress(
            name=program.name,
            by=owner.person.name,
            status=now.status,
            step=now.step,
            steps=now.steps,
            line=now.line,
            task=now.name,
            share=now.share,
            seconds=program.duration,
            why=now.why,
        )

    def _go_on(self) -> None:
        """Do what was to be done once a program is planned."""
        then, self._then = self._then, None
        assert then is not None
        assert self._owner is not None
        try:
            self.steer(self._owner, then)
        except LeaseError as error:
            assert self._planning is not None
            self._planning.program, self._planning.refused = None, str(error)

    def _begin(self, window: Window, *, single: bool) -> None:
        planning = self._planning
        if planning is None or planning.program is None:
            raise LeaseError("There is no program that is planned; send one first.")
        hub = self._hub
        if hub.lease.holder == window.person:
            hub.give_up(window)
        program = planning.program
        visitor = Visitor(f"program of {window.person.key}", program.name, Role.OPERATOR)
        joined = hub.join(visitor, "program", lambda _notice: None, _Here(hub.clock))
        try:
            hub.acquire(joined)
            # What is told first finds out whether the arm is stopped.
            hub.move(joined, cmd.Resume())
        except LeaseError:
            hub.leave(joined, for_good=True)
            raise
        self._self, self._owner, self._seen = joined, window, hub.clock()
        arm = hub.present()
        self._speed = arm.state.speed
        self._run = Run(self._seen, single=single)
        log.info("%s runs the program %s.", window.person.name, program.name)

    def _plan(self, planning: _Planning, text: str, speed: float, rig: Rig, state: State) -> None:
        def check() -> None:
            if self._hub.clock() - planning.began > LONGEST_PLANNING:
                raise InputError(
                    f"Planning takes longer than {LONGEST_PLANNING:g} s; make it shorter."
                )

        try:
            planning.program = compiled(parse(text), rig, state, speed, check)
        except KatanaError as error:
            planning.refused = str(error)
        except Exception:
            log.exception("Planning met an error.")
            planning.refused = "Planning met an error; see the server's log."

    def _tell(self, *commands: cmd.Command) -> None:
        assert self._self is not None
        for command in commands:
            self._hub.move(self._self, command)

    def _end(self, why: str) -> None:
        assert self._run is not None
        self._run, commands = runner.halted(self._run, why)
        # A stopped arm takes no commands, nor does one that does not answer.
        with suppress(LeaseError, InputError):
            self._tell(*commands)
        self._leave_with(Phase.STOPPED, why)

    def _leave_with(self, phase: Phase, why: str) -> None:
        """Give up the arm, which is at rest or comes to it."""
        assert self._self is not None
        assert self._run is not None
        joined, self._self = self._self, None
        self._run = runner.ended(self._run, phase, why)
        if self._hub.arm is not None:
            # A program's speed is its own.
            self._hub.arm.limit(self._speed)
        if self._hub.lease.holder == joined.person:
            self._hub.give_up(joined)
        self._hub.leave(joined, for_good=True)
        log.info("The program %s: %s", joined.person.name, why or f"{phase.value}.")

    def _check_free(self) -> None:
        if self.running:
            raise LeaseError("A program runs: end it first.")
        planning = self._planning
        if planning is not None and planning.program is None and planning.refused is None:
            raise LeaseError("Another program is being planned.")

    def _check_may_drive(self, window: Window) -> None:
        if not window.person.role.may_drive:
            raise LeaseError("You may watch, not drive.")

    def _check_owns(self, window: Window) -> None:
        owner = self._owner
        if owner is not None and owner.person != window.person and not window.person.role.may_take:
            raise LeaseError(f"The program is {owner.person.name}'s.")
