"""Laying out a script step by step: from where each leads the next is planned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.actions import Action, FollowPlan
from katana450.extensions.programs.plan_builder import GraspInfo, PlanBuilder, UntimedPath
from katana450.extensions.programs.script import LocatedStep, Script
from katana450.extensions.programs.situation import Situation
from katana450.extensions.programs.source import Problem, ScriptError

Orders = list[tuple[str, Action]]
"""Of a step, each with its name."""

FINDING, TIMING = "finding paths", "timing paths"
"""The two phases of planning."""

TIMING_FRACTION = 0.8
"""[1] The part of the whole time that timing takes, roughly."""


class PlanningStage(NamedTuple):
    """How far planning is. phase: FINDING or TIMING. step: under work, from 1, of ``steps``."""

    phase: str
    step: int
    steps: int

    @property
    def fraction(self) -> float:
        """The fraction of the whole work that is done, from 0 to 1, as an estimate."""
        done = (self.step - 1) / self.steps
        return (
            (1.0 - TIMING_FRACTION) * done
            if self.phase == FINDING
            else 1.0 + TIMING_FRACTION * (done - 1.0)
        )


Report = Callable[[PlanningStage], None]
"""Is given each stage as it begins."""


class CompiledScript(NamedTuple):
    """A step's orders as they are before its ways are timed, and what they lead to."""

    orders: list[tuple[str, Action | UntimedPath]]
    state: State
    taken: GraspInfo | None


class Compiler:
    """Every step in its turn; and back to where an object was taken, when that was no good.

    What is in the hand keeps the pitch it was taken with, so what comes later may need another:
    the next of them is tried then, each once, before the script is refused.
    """

    def __init__(
        self, script: Script, builder: PlanBuilder, report: Report = lambda _: None
    ) -> None:
        """``report``: given every stage; what it raises ends the planning."""
        self._script = script
        self._builder = builder
        self._report = report
        self._compiled_steps: list[CompiledScript] = []
        # A repetition from where it began is planned already.
        self._known: dict[tuple[object, ...], CompiledScript] = {}
        self._plans: dict[int, FollowPlan] = {}
        # The number of the step that took what is held, with the arm as it was before.
        self._grasp: tuple[int, State] | None = None
        self._refused: Problem | None = None

    def all(self) -> list[Orders]:
        """Those of each step. Raises ScriptError with the line of the one that cannot be."""
        steps = self._script.steps
        while len(self._compiled_steps) < len(steps):
            number = len(self._compiled_steps)
            before, taken = self._builder.state, self._builder.taken
            self._builder.ahead = [placed.step for placed in steps[number + 1 :]]
            self._report(PlanningStage(FINDING, number + 1, len(steps)))
            try:
                compiled_step = self._step(steps[number])
            except ScriptError as error:
                self._refused = self._refused or error.problems[0]
                if not self._go_back():
                    raise self._told() from error
                continue
            self._compiled_steps.append(compiled_step)
            _, self._builder.state, self._builder.taken = compiled_step
            self._note_grasp(taken, (number, before))
        # What can be done is known now, so that the time it takes is sought for nothing else.
        found: list[Orders] = []
        for number, compiled_step in enumerate(self._compiled_steps, 1):
            self._report(PlanningStage(TIMING, number, len(steps)))
            found.append(self._timed(compiled_step))
        return found

    def _step(self, placed: LocatedStep) -> CompiledScript:
        builder = self._builder
        key = id(placed.step), *_situation(builder)
        if key in self._known:
            return self._known[key]
        builder.orders = []
        try:
            placed.step.build(builder)
        except InputError as error:
            raise _at(placed, error) from error
        compiled_step = CompiledScript(builder.orders, builder.state, builder.taken)
        if any(isinstance(order, UntimedPath) for _, order in compiled_step.orders):
            self._known[key] = compiled_step
        return compiled_step

    def _timed(self, compiled_step: CompiledScript) -> Orders:
        found: Orders = []
        for name, order in compiled_step.orders:
            if isinstance(order, UntimedPath):
                if id(order) not in self._plans:
                    self._plans[id(order)] = order.timed()
                found.append((name, self._plans[id(order)]))
            else:
                found.append((name, order))
        return found

    def _note_grasp(self, before: GraspInfo | None, place: tuple[int, State]) -> None:
        """Remember where an object was taken at a pitch of choice, until it is set down."""
        builder = self._builder
        if builder.taken is None:
            self._grasp, self._refused, builder.given_up = None, None, ()
        elif builder.taken is not before:
            self._grasp = None if builder.taken.chosen is None else place

    def _go_back(self) -> bool:
        """To where what is held was taken, for the next pitch; False where there is no choice."""
        builder = self._builder
        if self._grasp is None or builder.taken is None or builder.taken.chosen is None:
            return False
        number, builder.state = self._grasp
        builder.given_up = (*builder.given_up, builder.taken.chosen)
        builder.taken, self._grasp = None, None
        del self._compiled_steps[number:]
        return True

    def _told(self) -> ScriptError:
        assert self._refused is not None
        said = self._refused.text
        tried = [f"{angle:.0f}" for angle in np.degrees(self._builder.given_up)]
        if len(tried) > 1:
            pitches = ", ".join(tried[:-1]) + f" and {tried[-1]}"
            said += f" It is no better at another pitch it can be taken at: tried {pitches} deg."
        return ScriptError((replace(self._refused, text=said),))


def _at(placed: LocatedStep, error: InputError) -> ScriptError:
    return ScriptError((Problem(placed.line, placed.column, str(error)),))


def _situation(builder: PlanBuilder) -> tuple[object, ...]:
    """What a step's plans depend on."""
    taken = None if builder.taken is None else builder.taken.at.position.tobytes()
    return Situation.of(builder.state).key, taken, builder.given_up
