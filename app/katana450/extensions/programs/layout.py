"""Laying out a script step by step: from where each leads the next is planned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.bench import Bench, Draft, GraspInfo
from katana450.extensions.programs.order import Go, Order
from katana450.extensions.programs.script import Placed, Script
from katana450.extensions.programs.situation import Situation
from katana450.extensions.programs.source import Problem, ScriptError

Orders = list[tuple[str, Order]]
"""Of a step, each with its name."""

FINDING, TIMING = "finding paths", "timing paths"
"""The two phases of planning."""

TIMING_TAKES = 0.8
"""[1] The part of the whole time that timing takes, roughly."""


class PlanningStage(NamedTuple):
    """How far planning is. phase: FINDING or TIMING. step: under work, from 1, of ``steps``."""

    phase: str
    step: int
    steps: int

    @property
    def share(self) -> float:
        """The fraction of the whole work that is done, from 0 to 1, as an estimate."""
        done = (self.step - 1) / self.steps
        return (
            (1.0 - TIMING_TAKES) * done
            if self.phase == FINDING
            else 1.0 + TIMING_TAKES * (done - 1.0)
        )


Report = Callable[[PlanningStage], None]
"""Is given each stage as it begins."""


class Laid(NamedTuple):
    """A step's orders as they are before its ways are timed, and what they lead to."""

    orders: list[tuple[str, Order | Draft]]
    state: State
    taken: GraspInfo | None


class Layout:
    """Every step in its turn; and back to where a thing was taken, when that was no good.

    What is in the hand keeps the pitch it was taken with, so what comes later may need another:
    the next of them is tried then, each once, before the script is refused.
    """

    def __init__(self, script: Script, bench: Bench, report: Report = lambda _: None) -> None:
        """``report``: given every stage; what it raises ends the planning."""
        self._script = script
        self._bench = bench
        self._report = report
        self._laid: list[Laid] = []
        # A repetition from where it began is planned already.
        self._known: dict[tuple[object, ...], Laid] = {}
        self._plans: dict[int, Go] = {}
        # The number of the step that took what is held, with the arm as it was before.
        self._grasp: tuple[int, State] | None = None
        self._refused: Problem | None = None

    def all(self) -> list[Orders]:
        """Those of each step. Raises ScriptError with the line of the one that cannot be."""
        steps = self._script.steps
        while len(self._laid) < len(steps):
            number = len(self._laid)
            before, taken = self._bench.state, self._bench.taken
            self._bench.ahead = [placed.step for placed in steps[number + 1 :]]
            self._report(PlanningStage(FINDING, number + 1, len(steps)))
            try:
                laid = self._step(steps[number])
            except ScriptError as error:
                self._refused = self._refused or error.problems[0]
                if not self._go_back():
                    raise self._told() from error
                continue
            self._laid.append(laid)
            _, self._bench.state, self._bench.taken = laid
            self._note_grasp(taken, (number, before))
        # What can be done is known now, so that the time it takes is sought for nothing else.
        found: list[Orders] = []
        for number, laid in enumerate(self._laid, 1):
            self._report(PlanningStage(TIMING, number, len(steps)))
            found.append(self._timed(laid))
        return found

    def _step(self, placed: Placed) -> Laid:
        bench = self._bench
        key = id(placed.step), *_situation(bench)
        if key in self._known:
            return self._known[key]
        bench.orders = []
        try:
            placed.step.lay(bench)
        except InputError as error:
            raise _at(placed, error) from error
        laid = Laid(bench.orders, bench.state, bench.taken)
        if any(isinstance(order, Draft) for _, order in laid.orders):
            self._known[key] = laid
        return laid

    def _timed(self, laid: Laid) -> Orders:
        found: Orders = []
        for name, order in laid.orders:
            if isinstance(order, Draft):
                if id(order) not in self._plans:
                    self._plans[id(order)] = order.timed()
                found.append((name, self._plans[id(order)]))
            else:
                found.append((name, order))
        return found

    def _note_grasp(self, before: GraspInfo | None, place: tuple[int, State]) -> None:
        """Remember where a thing was taken at a pitch of choice, until it is set down."""
        bench = self._bench
        if bench.taken is None:
            self._grasp, self._refused, bench.given_up = None, None, ()
        elif bench.taken is not before:
            self._grasp = None if bench.taken.chosen is None else place

    def _go_back(self) -> bool:
        """To where what is held was taken, for the next pitch; False where there is no choice."""
        bench = self._bench
        if self._grasp is None or bench.taken is None or bench.taken.chosen is None:
            return False
        number, bench.state = self._grasp
        bench.given_up = (*bench.given_up, bench.taken.chosen)
        bench.taken, self._grasp = None, None
        del self._laid[number:]
        return True

    def _told(self) -> ScriptError:
        assert self._refused is not None
        said = self._refused.said
        tried = [f"{angle:.0f}" for angle in np.degrees(self._bench.given_up)]
        if len(tried) > 1:
            pitches = ", ".join(tried[:-1]) + f" and {tried[-1]}"
            said += f" It is no better at another pitch it can be taken at: tried {pitches} deg."
        return ScriptError((replace(self._refused, said=said),))


def _at(placed: Placed, error: InputError) -> ScriptError:
    return ScriptError((Problem(placed.line, placed.column, str(error)),))


def _situation(bench: Bench) -> tuple[object, ...]:
    """What a step's plans depend on."""
    taken = None if bench.taken is None else bench.taken.at.position.tobytes()
    return Situation.of(bench.state).key, taken, bench.given_up
