"""Laying out a script step by step: from where each leads the next is planned."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from app.control.state import State
from app.errors import InputError
from app.programs.bench import Bench, Draft, Taken
from app.programs.order import Go, Order
from app.programs.script import Placed, Script
from app.programs.source import Problem, ScriptError

Orders = list[tuple[str, Order]]
"""Of a step, each with its name."""


class Laid(NamedTuple):
    """A step's orders as they are before its ways are timed, and what they lead to."""

    orders: list[tuple[str, Order | Draft]]
    state: State
    taken: Taken | None


class Layout:
    """Every step in its turn; and back to where a thing was taken, when that was no good.

    What is in the hand keeps the pitch it was taken with, so what comes later may need another:
    the next of them is tried then, each once, before the script is refused.
    """

    def __init__(
        self, script: Script, bench: Bench, check: Callable[[], None] | None = None
    ) -> None:
        """``check``: asked before each step; what it raises ends the planning."""
        self._script = script
        self._bench = bench
        self._check = check
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
            self._ask(steps[number])
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
        return [self._timed(*each) for each in zip(steps, self._laid, strict=True)]

    def _ask(self, placed: Placed) -> None:
        try:
            if self._check is not None:
                self._check()
        except InputError as error:
            raise _at(placed, error) from error

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

    def _timed(self, placed: Placed, laid: Laid) -> Orders:
        found: Orders = []
        for name, order in laid.orders:
            if isinstance(order, Draft):
                if id(order) not in self._plans:
                    self._ask(placed)
                    self._plans[id(order)] = order.timed()
                found.append((name, self._plans[id(order)]))
            else:
                found.append((name, order))
        return found

    def _note_grasp(self, before: Taken | None, place: tuple[int, State]) -> None:
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
    state = bench.state
    things = tuple((each.name, each.T.tobytes(), each.held) for each in state.things)
    water = None if state.poured is None else state.poured.water.cup
    taken = None if bench.taken is None else bench.taken.at.position.tobytes()
    fingers = state.gripper_setpoint
    return state.setpoint.tobytes(), fingers, state.tool, things, water, taken, bench.given_up
