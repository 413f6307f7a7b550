"""Compilation of a script: each step is planned from the state in which the one before it ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from katana450.arm.control.state import State
from katana450.errors import InputError, PathError
from katana450.extensions.programs.actions import Action, FollowPlan
from katana450.extensions.programs.blocks import LocatedStep
from katana450.extensions.programs.plan_builder import GraspInfo, PlanBuilder, UntimedPath
from katana450.extensions.programs.script import Script
from katana450.extensions.programs.situation import Situation
from katana450.extensions.programs.source import Problem, ScriptError

Actions = list[tuple[str, Action]]
"""The actions of one step, each with its name."""

FINDING, TIMING = "finding paths", "timing paths"
"""The two phases of planning."""

TIMING_FRACTION = 0.8
"""[1] Approximate fraction of the planning time that the timing takes."""


class PlanningStage(NamedTuple):
    """The progress of planning.

    Attributes:
        phase: FINDING or TIMING.
        step: step in progress, from 1.
        steps: number of steps.
    """

    phase: str
    step: int
    steps: int

    @property
    def fraction(self) -> float:
        """The estimated fraction of the work that is done, from 0 to 1."""
        done = (self.step - 1) / self.steps
        return (
            (1.0 - TIMING_FRACTION) * done
            if self.phase == FINDING
            else 1.0 + TIMING_FRACTION * (done - 1.0)
        )


Report = Callable[[PlanningStage], None]
"""A function that is called with each stage as it begins."""


class CompiledStep(NamedTuple):
    """The actions of a step before its paths are timed, and the state at its end."""

    actions: list[tuple[str, Action | UntimedPath]]
    state: State
    taken: GraspInfo | None


class Compiler:
    """The compiler of a script, with backtracking to the last grasp when a later step fails.

    An object in the hand keeps the pitch at which it was grasped, and a later step may need
    another. The compiler then tries the remaining pitches, each once, before it refuses the script.
    """

    def __init__(
        self, script: Script, builder: PlanBuilder, report: Report = lambda _: None
    ) -> None:
        """Prepare to compile. ``report`` is called with every stage.

        An error that ``report`` raises ends the planning.
        """
        self._script = script
        self._builder = builder
        self._report = report
        self._compiled_steps: list[CompiledStep] = []
        # A step repeated in the same situation is planned only once.
        self._known: dict[tuple[object, ...], CompiledStep] = {}
        self._plans: dict[int, FollowPlan] = {}
        # The number of the step that grasped the held object, and the state before that step.
        self._grasp: tuple[int, State] | None = None
        self._refused: Problem | None = None

    def all(self) -> list[Actions]:
        """Return the actions of each step. Raises ScriptError with the line of a failed step."""
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
                    raise self._error() from error
                continue
            self._compiled_steps.append(compiled_step)
            _, self._builder.state, self._builder.taken = compiled_step
            self._note_grasp(taken, (number, before))
        # Paths are timed last, so that no time is spent on a script that is refused.
        found: list[Actions] = []
        for number, compiled_step in enumerate(self._compiled_steps, 1):
            self._report(PlanningStage(TIMING, number, len(steps)))
            found.append(self._timed(compiled_step))
        return found

    def _step(self, placed: LocatedStep) -> CompiledStep:
        builder = self._builder
        key = id(placed.step), *_situation(builder)
        if key in self._known:
            return self._known[key]
        builder.actions = []
        try:
            placed.step.build(builder)
        except InputError as error:
            raise _at(placed, self._in_frame(error)) from error
        compiled_step = CompiledStep(builder.actions, builder.state, builder.taken)
        if any(isinstance(action, UntimedPath) for _, action in compiled_step.actions):
            self._known[key] = compiled_step
        return compiled_step

    def _in_frame(self, error: InputError) -> InputError:
        """Return ``error`` with its point in the frame of the script."""
        if not (isinstance(error, PathError) and self._script.in_base):
            return error
        T = self._builder.plan_context.T_base_shoulder
        point = T[:3, :3] @ error.point + T[:3, 3]
        return PathError(error.text, point.tolist(), "the base frame")

    def _timed(self, compiled_step: CompiledStep) -> Actions:
        found: Actions = []
        for name, action in compiled_step.actions:
            if isinstance(action, UntimedPath):
                if id(action) not in self._plans:
                    self._plans[id(action)] = action.timed()
                found.append((name, self._plans[id(action)]))
            else:
                found.append((name, action))
        return found

    def _note_grasp(self, before: GraspInfo | None, place: tuple[int, State]) -> None:
        """Record the step that grasped an object at a freely chosen pitch, until it is set down."""
        builder = self._builder
        if builder.taken is None:
            self._grasp, self._refused, builder.given_up = None, None, ()
        elif builder.taken is not before:
            self._grasp = None if builder.taken.chosen is None else place

    def _go_back(self) -> bool:
        """Return to the grasp to try the next pitch; return False if there is no alternative."""
        builder = self._builder
        if self._grasp is None or builder.taken is None or builder.taken.chosen is None:
            return False
        number, builder.state = self._grasp
        builder.given_up = (*builder.given_up, builder.taken.chosen)
        builder.taken, self._grasp = None, None
        del self._compiled_steps[number:]
        return True

    def _error(self) -> ScriptError:
        assert self._refused is not None
        text = self._refused.text
        pitches_tried = dict.fromkeys(each.pitch for each in self._builder.given_up)
        tried = [f"{angle:.0f}" for angle in np.degrees(list(pitches_tried))]
        if len(tried) > 1:
            pitches = ", ".join(tried[:-1]) + f" and {tried[-1]}"
            text += f" No other pitch of the grasp helps: tried {pitches} deg."
        return ScriptError((replace(self._refused, text=text),))


def _at(placed: LocatedStep, error: InputError) -> ScriptError:
    return ScriptError((Problem(placed.line, placed.column, str(error)),))


def _situation(builder: PlanBuilder) -> tuple[object, ...]:
    """Return a hashable key of everything on which the plans of a step depend."""
    taken = None if builder.taken is None else builder.taken.at.position.tobytes()
    return Situation.of(builder.state).key, taken, builder.given_up
