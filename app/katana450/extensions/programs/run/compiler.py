"""Compilation of a script: each step is planned from the state in which the one before it ends.

Both alternatives of an ``if`` are planned from the same state. The steps after it are planned for
each of them, until both are in the same situation, and then once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence, Set
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from katana450.arm.control.messages import part
from katana450.arm.control.state import State
from katana450.errors import InputError, PathError
from katana450.extensions.programs.building.actions import Action, FollowPlan, Task
from katana450.extensions.programs.building.conditions import Condition, Held, ProgramTime
from katana450.extensions.programs.building.located_step import (
    Conditional,
    LocatedStep,
    NumberedStep,
    count,
    numbered,
)
from katana450.extensions.programs.building.plan_builder import (
    EXACT,
    GraspInfo,
    PlanBuilder,
    UntimedPath,
)
from katana450.extensions.programs.building.step import Step
from katana450.extensions.programs.language.source import Problem, ScriptError
from katana450.extensions.programs.planning.approach import Approach
from katana450.extensions.programs.run.situation import Situation
from katana450.extensions.programs.run.task_list import PlannedChoice, PlannedStep, task_list
from katana450.extensions.programs.script.script import Script
from katana450.extensions.programs.steps.settings_steps import Speed, Tool

FINDING, TIMING = "finding paths", "timing paths"
"""The two phases of planning."""

TIMING_FRACTION = 0.8
"""[1] Approximate fraction of the planning time that the timing takes."""

JOIN_AFTER = (0, 1, 2, 4)
"""Numbers of steps after an ``if`` at which its alternatives may join."""

MAX_COPIES = 16
"""Maximum number of situations for which a step after alternatives is planned."""

TOO_MANY_COPIES = (
    f"The steps after this `if` would be planned for more than {MAX_COPIES} situations, in which "
    "the alternatives so far end. Let alternatives end in the same place, for example with `home`."
)


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


class _Place(NamedTuple):
    """The place of the planning: everything that a later attempt starts from."""

    state: State
    taken: GraspInfo | None
    given_up: tuple[Approach, ...]
    # The number of situations for which the next steps are planned.
    copies: int


class _Line(NamedTuple):
    """Steps that are planned one after another, and the different places where they end."""

    steps: list[PlannedStep | PlannedChoice]
    ends: tuple[_Place, ...]


class Compiler:
    """The compiler of a script, with backtracking to the last grasp when a later step fails.

    An object in the hand keeps the pitch at which it was grasped, and a later step may need
    another. The compiler then tries the remaining pitches, each once, before it refuses the script.
    A grasp inside an ``if`` is tried again for later steps of the same alternative, and for those
    after the ``if`` that are planned for this alternative alone.
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
        self._steps = count(script.steps)
        # A step repeated in the same situation is planned only once.
        self._known: dict[tuple[object, ...], CompiledStep] = {}
        self._plans: dict[int, FollowPlan] = {}
        self._copies = 1

    def tasks(self, first: int = 0) -> tuple[Task, ...]:
        """Return the tasks from the step with the index ``first``.

        Of the steps before it only those are planned that choose the tool frame or the speed.
        Raises InputError if no step, or one inside an ``if``, has this index, and ScriptError with
        the line of a step that is not possible.
        """
        steps = [
            each
            for each in numbered(self._script.steps, 0)
            if each.number >= first or isinstance(each.located.step, Tool | Speed)
        ]
        if first and first not in (each.number for each in steps):
            raise InputError(self._no_beginning(first))
        line = self._line(steps, len(steps))
        # Paths are timed last, so that no time is spent on a script that is refused.
        return task_list(line.steps, self._timed)

    def _no_beginning(self, first: int) -> str:
        """Return why the program cannot begin at the step with the index ``first``."""
        if first >= self._steps:
            return f"There is no step {first + 1}: {self._script.name} has {self._steps} steps."
        outer = max(each.number for each in numbered(self._script.steps, 0) if each.number < first)
        return f"Step {first + 1} is inside an `if`. Begin at step {outer + 1}, the `if`."

    def _line(self, steps: Sequence[NumberedStep], end: int) -> _Line:
        """Plan ``steps[:end]`` one after another, from the present place. Raises ScriptError."""
        builder = self._builder
        found: list[PlannedStep | PlannedChoice] = []
        # The index of the step that grasped the held object, and the place before that step.
        grasp: tuple[int, _Place] | None = None
        refused: Problem | None = None
        reasons: set[Problem] = set()
        while (index := sum(each.used for each in found)) < end:
            before = self._place
            try:
                planned, ends = self._one(steps, index, end)
            except ScriptError as error:
                self._return_to(before)
                refused = refused or error.problems[0]
                reasons.add(error.problems[0])
                if grasp is None or builder.taken is None or builder.taken.chosen is None:
                    raise self._error(refused, reasons) from error
                given_up = (*builder.given_up, builder.taken.chosen)
                number, place = grasp
                self._return_to(place._replace(given_up=given_up))
                grasp = None
                del found[number:]
                continue
            found.append(planned)
            if len(ends) > 1:
                # The alternatives of an `if` have all steps that follow.
                return _Line(found, ends)
            if builder.taken is None:
                grasp, refused, builder.given_up = None, None, ()
                reasons.clear()
            elif builder.taken is not before.taken:
                tried_again = builder.taken.chosen is not None and isinstance(planned, PlannedStep)
                grasp = (len(found) - 1, before) if tried_again else None
        return _Line(found, (self._place,))

    def _one(
        self, steps: Sequence[NumberedStep], index: int, end: int
    ) -> tuple[PlannedStep | PlannedChoice, tuple[_Place, ...]]:
        """Plan the step ``index`` of ``steps``; an ``if`` with those up to ``end`` that it needs.

        The second value has the places where it ends. Raises ScriptError.
        """
        number, located = steps[index]
        self._report(PlanningStage(FINDING, number + 1, self._steps))
        if isinstance(located.step, Conditional):
            return self._choice(number, located, located.step, steps[index + 1 : end])
        self._builder.ahead = [each.located.step for each in steps[index + 1 :]]
        compiled_step = self._step(located, located.step)
        _, self._builder.state, self._builder.taken = compiled_step
        return PlannedStep(number, located, compiled_step.actions), (self._place,)

    def _choice(
        self,
        number: int,
        located: LocatedStep,
        step: Conditional,
        rest: Sequence[NumberedStep],
    ) -> tuple[PlannedChoice, tuple[_Place, ...]]:
        """Plan both alternatives of an ``if``, and steps of ``rest`` in each until they agree."""
        condition: Condition | ProgramTime = step.condition
        predicted = None
        if not isinstance(condition, ProgramTime):
            try:
                condition = condition.checked(self._builder)
            except InputError as error:
                raise _at(located, error) from error
            predicted = condition.holds(self._builder.state)
        alternatives = (
            list(numbered(step.then, number + 1)),
            list(numbered(step.otherwise, number + 1 + count(step.then))),
        )
        before = self._place
        starts = [before, before]
        if isinstance(condition, Held) and predicted:
            # Otherwise `else` could not even grasp the object again.
            self._builder.assume_missed()
            starts[1] = self._place
        used = 0
        for used in sorted({min(most, len(rest)) for most in (*JOIN_AFTER, len(rest))}):
            copies = before.copies * (2 if used else 1)
            if copies > MAX_COPIES:
                raise _at(located, InputError(TOO_MANY_COPIES))
            lines = [
                self._line_from(start._replace(copies=copies), [*inner, *rest], len(inner) + used)
                for start, inner in zip(starts, alternatives, strict=True)
            ]
            ends = _different(end for line in lines for end in line.ends)
            if len(ends) == 1:
                break
        self._return_to(ends[0]._replace(copies=before.copies))
        then, otherwise = (line.steps for line in lines)
        choice = PlannedChoice(number, located, condition, predicted, then, otherwise, 1 + used)
        return choice, ends

    def _line_from(self, place: _Place, steps: Sequence[NumberedStep], end: int) -> _Line:
        """Plan ``steps[:end]`` from ``place``. Raises ScriptError."""
        self._return_to(place)
        return self._line(steps, end)

    @property
    def _place(self) -> _Place:
        builder = self._builder
        return _Place(builder.state, builder.taken, builder.given_up, self._copies)

    def _return_to(self, place: _Place) -> None:
        builder = self._builder
        builder.state, builder.taken, builder.given_up, self._copies = place

    def _step(self, located: LocatedStep, step: Step) -> CompiledStep:
        """Plan one step from the present place. Raises ScriptError."""
        builder = self._builder
        key = id(step), *_situation(builder)
        if key in self._known:
            return self._known[key]
        builder.actions = []
        try:
            step.build(builder)
        except InputError as error:
            raise _at(located, self._for_people(error)) from error
        compiled_step = CompiledStep(builder.actions, builder.state, builder.taken)
        if any(isinstance(action, UntimedPath) for _, action in compiled_step.actions):
            self._known[key] = compiled_step
        return compiled_step

    def _for_people(self, error: InputError) -> InputError:
        """Return ``error`` with its point in the frame of the script, and names for people."""
        if not isinstance(error, PathError):
            return error
        point, frame = error.point, "{S}"
        if self._script.in_base and point:
            T = self._builder.plan_context.T_base_shoulder
            point, frame = (T[:3, :3] @ point + T[:3, 3]).tolist(), "the base frame"
        return PathError(error.text, point, frame, tuple(map(part, error.parts)))

    def _timed(self, step: PlannedStep) -> Iterator[tuple[str, Action]]:
        """Yield the actions of ``step`` with all paths timed. Raises ScriptError."""
        self._report(PlanningStage(TIMING, step.number + 1, self._steps))
        for name, action in step.actions:
            if not isinstance(action, UntimedPath):
                yield name, action
                continue
            if id(action) not in self._plans:
                try:
                    self._plans[id(action)] = action.timed()
                except InputError as error:
                    raise _at(step.located, error) from error
            yield name, self._plans[id(action)]

    def _error(self, refused: Problem, reasons: Set[Problem]) -> ScriptError:
        """Return the first refusal, with the other pitches of the grasp that have failed too.

        ``reasons``: the refusals with all pitches. A reason that is the same with each of them has
        nothing to do with the pitch.
        """
        text = refused.text
        pitches_tried = dict.fromkeys(each.pitch for each in self._builder.given_up)
        tried = [f"{angle:.0f}" for angle in np.degrees(list(pitches_tried))]
        at_step = [each for each in reasons if each.line == refused.line]
        if len(tried) > 1 and len(at_step) > 1:
            pitches = ", ".join(tried[:-1]) + f" and {tried[-1]}"
            text += f" No other pitch of the grasp helps: tried {pitches} deg."
        return ScriptError((replace(refused, text=text),))


def _at(located: LocatedStep, error: InputError) -> ScriptError:
    return ScriptError((Problem(located.line, located.column, str(error), located.file),))


def _situation(builder: PlanBuilder) -> tuple[object, ...]:
    """Return a hashable key of everything on which the plans of a step depend."""
    taken = None if builder.taken is None else builder.taken.at.position.tobytes()
    return Situation.of(builder.state).key, taken, builder.given_up


def _different(ends: Iterable[_Place]) -> tuple[_Place, ...]:
    """Return ``ends`` without those that are the same as one before."""
    found: list[_Place] = []
    for end in ends:
        if not any(_same(end, other) for other in found):
            found.append(end)
    return tuple(found)


def _same(one: _Place, other: _Place) -> bool:
    """Return whether a plan that begins in one place can also begin in the other."""
    if Situation.of(one.state).changed_to(Situation.of(other.state)):
        return False
    if one.taken is None or other.taken is None:
        return one.taken is other.taken
    return max(one.taken.at.apart(other.taken.at)) <= EXACT
