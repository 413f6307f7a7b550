"""Compilation of a script: each step is planned from the state in which the one before it ends.

Both alternatives of an ``if`` are planned from the same state. The steps after it are planned for
each of them, until both are in the same situation, and then once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from katana450.arm.control.state.messages import part
from katana450.errors import InputError, PathError
from katana450.extensions.programs.building.actions import Action, FollowPlan, SetSpeed, Task
from katana450.extensions.programs.building.plan_state import (
    EXACT,
    PlanState,
    UntimedPath,
)
from katana450.extensions.programs.building.step import (
    Condition,
    Conditional,
    Held,
    LocatedStep,
    NumberedStep,
    Step,
    count,
    numbered,
)
from katana450.extensions.programs.language.source import Problem, ScriptError
from katana450.extensions.programs.run.situation import Situation
from katana450.extensions.programs.script.script import Script
from katana450.extensions.programs.steps.settings_steps import Speed, Tool


@dataclass(frozen=True, eq=False)
class ConditionalJump(Action):
    """Continue with another task, by a condition that is measured at that moment.

    Attributes:
        condition: the condition.
        predicted: whether it holds in the state that the planning predicts.
        then, otherwise: index of the task that follows if it holds, and if it does not.
    """

    condition: Condition
    predicted: bool
    then: int
    otherwise: int


@dataclass(frozen=True, eq=False)
class PlannedStep:
    """A step with its actions.

    Attributes:
        number: index of the step in the script, from 0.
        located: the step.
        actions: its actions, each with its name; their paths may not be timed yet.
        used: number of steps of the script that it stands for.
    """

    number: int
    located: LocatedStep
    actions: Sequence[tuple[str, Action | UntimedPath]]
    used: int = 1


@dataclass(frozen=True, eq=False)
class PlannedChoice:
    """An ``if`` with the steps of both alternatives, and with those after it if their ends differ.

    Attributes:
        number: index of the step in the script, from 0.
        located: the step.
        condition: its condition for this arm.
        predicted: whether it holds in the state that is predicted.
        then, otherwise: the steps that follow if it holds, and if it does not.
        used: number of steps of the script that it stands for, the ``if`` and those after it.
    """

    number: int
    located: LocatedStep
    condition: Condition
    predicted: bool
    then: PlannedSteps
    otherwise: PlannedSteps
    used: int


PlannedSteps = Sequence[PlannedStep | PlannedChoice]
"""Steps in their order; what follows the last one is the end, or what follows the ``if``."""


TimedActions = Callable[[PlannedStep], Iterable[tuple[str, Action]]]
"""A function that returns the actions of a step with all paths timed. It raises ScriptError."""


def task_list(steps: PlannedSteps, timed: TimedActions) -> tuple[Task, ...]:
    """Return the tasks of ``steps``. The first sets the speed; the others are in their order.

    A task leads only to later ones. The number of tasks stands for the end.
    """
    first = Task(steps[0].number, 1, "speed", SetSpeed(1.0))
    return (first, *_tasks(steps, 1, 1 + _task_count(steps), timed))


def _tasks(steps: PlannedSteps, number: int, following: int, timed: TimedActions) -> Iterator[Task]:
    """Yield the tasks of ``steps``, the first with the index ``number``.

    ``following``: index of the task that follows the last one.
    """
    steps = [step for step in steps if _task_count((step,))]
    for step in steps:
        end = number + _task_count((step,))
        after = following if step is steps[-1] else end
        line = step.located.line
        if isinstance(step, PlannedChoice):
            otherwise = number + 1 + _task_count(step.then)
            jump = ConditionalJump(
                step.condition,
                step.predicted,
                number + 1 if _task_count(step.then) else after,
                otherwise if _task_count(step.otherwise) else after,
            )
            yield Task(step.number, line, f"if {step.condition.words}", jump)
            yield from _tasks(step.then, number + 1, after, timed)
            yield from _tasks(step.otherwise, otherwise, after, timed)
        else:
            for index, (name, action) in enumerate(timed(step), number + 1):
                leaps = index == end and after != end
                yield Task(step.number, line, name, action, after if leaps else None)
        number = end


def _task_count(steps: PlannedSteps) -> int:
    """Return the number of the tasks of ``steps``, with those of all alternatives."""
    return sum(
        1 + _task_count(step.then) + _task_count(step.otherwise)
        if isinstance(step, PlannedChoice)
        else len(step.actions)
        for step in steps
    )


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


class _Line(NamedTuple):
    """Steps that are planned one after another, and the different plans with which they end."""

    steps: list[PlannedStep | PlannedChoice]
    ends: tuple[PlanState, ...]


class Compiler:
    """The compiler of a script, with backtracking to the last grasp when a later step fails.

    An object in the hand keeps the pitch at which it was grasped, and a later step may need
    another. The compiler then tries the remaining pitches, each once, before it refuses the script.
    A grasp inside an ``if`` is tried again for later steps of the same alternative, and for those
    after the ``if`` that are planned for this alternative alone.
    """

    def __init__(self, script: Script, begin: PlanState, report: Report = lambda _: None) -> None:
        """Prepare to compile from ``begin``. ``report`` is called with every stage.

        An error that ``report`` raises ends the planning.
        """
        self._script = script
        self._begin = begin
        self._report = report
        self._steps = count(script.steps)
        # A step repeated in the same situation is planned only once.
        self._known: dict[tuple[object, ...], PlanState] = {}
        self._plans: dict[int, FollowPlan] = {}

    def tasks(self, first: int = 0) -> tuple[Task, ...]:
        """Return the tasks from the step with the index ``first``.

        Of the steps before it only those are planned that choose the tool frame or the speed.
        Raises InputError if no step, or one inside an ``if``, has this index, and ScriptError with
        the line of a step that is not possible.
        """
        steps = [
            step
            for step in numbered(self._script.steps, 0)
            if step.number >= first or isinstance(step.located.step, Tool | Speed)
        ]
        if first and first not in (step.number for step in steps):
            raise InputError(self._no_beginning(first))
        line = self._line(self._begin, steps, len(steps), 1)
        # Paths are timed last, so that no time is spent on a script that is refused.
        return task_list(line.steps, self._timed)

    def _no_beginning(self, first: int) -> str:
        """Return why the program cannot begin at the step with the index ``first``."""
        if first >= self._steps:
            return f"There is no step {first + 1}: {self._script.name} has {self._steps} steps."
        outer = max(step.number for step in numbered(self._script.steps, 0) if step.number < first)
        return f"Step {first + 1} is inside an `if`. Begin at step {outer + 1}, the `if`."

    def _line(self, plan: PlanState, steps: Sequence[NumberedStep], end: int, copies: int) -> _Line:
        """Plan ``steps[:end]`` one after another. Raises ScriptError.

        ``copies``: the number of situations for which they are planned.
        """
        line: list[PlannedStep | PlannedChoice] = []
        # The index of the step that grasped the held object, and the plan before that step.
        grasp: tuple[int, PlanState] | None = None
        # The first refusal is that of the grasp which a person expects.
        refused: ScriptError | None = None
        while (index := sum(planned.used for planned in line)) < end:
            try:
                planned, ends = self._one(plan, steps, index, end, copies)
            except ScriptError as error:
                refused = refused or error
                if grasp is None or plan.taken is None or plan.taken.chosen is None:
                    raise refused from error
                given_up = (*plan.given_up, plan.taken.chosen)
                number, before_grasp = grasp
                plan, grasp = replace(before_grasp, given_up=given_up), None
                del line[number:]
                continue
            line.append(planned)
            if len(ends) > 1:
                # The alternatives of an `if` have all steps that follow.
                return _Line(line, ends)
            before, plan = plan, ends[0]
            if plan.taken is None:
                grasp, refused, plan = None, None, replace(plan, given_up=())
            elif plan.taken is not before.taken:
                tried_again = plan.taken.chosen is not None and isinstance(planned, PlannedStep)
                grasp = (len(line) - 1, before) if tried_again else None
        return _Line(line, (plan,))

    def _one(
        self, plan: PlanState, steps: Sequence[NumberedStep], index: int, end: int, copies: int
    ) -> tuple[PlannedStep | PlannedChoice, tuple[PlanState, ...]]:
        """Plan the step ``index`` of ``steps``; an ``if`` with those up to ``end`` that it needs.

        The second value has the plans with which it ends. Raises ScriptError.
        """
        number, located = steps[index]
        self._report(PlanningStage(FINDING, number + 1, self._steps))
        if isinstance(located.step, Conditional):
            rest = steps[index + 1 : end]
            return self._choice(plan, number, located, located.step, rest, copies)
        next_steps = [step.located.step for step in steps[index + 1 :]]
        after = self._step(replace(plan, ahead=next_steps, actions=()), located, located.step)
        return PlannedStep(number, located, after.actions), (after,)

    def _choice(
        self,
        plan: PlanState,
        number: int,
        located: LocatedStep,
        step: Conditional,
        rest: Sequence[NumberedStep],
        copies: int,
    ) -> tuple[PlannedChoice, tuple[PlanState, ...]]:
        """Plan both alternatives of an ``if``, and steps of ``rest`` in each until they agree."""
        try:
            condition = step.condition.checked(plan)
        except InputError as error:
            raise _at(located, error) from error
        predicted = condition.holds(plan.state)
        alternatives = (
            list(numbered(step.then, number + 1)),
            list(numbered(step.otherwise, number + 1 + count(step.then))),
        )
        # Otherwise `else` could not even grasp the object again.
        is_missed = isinstance(condition, Held) and predicted
        starts = (plan, plan.with_missed_grasp() if is_missed else plan)
        used = 0
        for used in sorted({min(most, len(rest)) for most in (*JOIN_AFTER, len(rest))}):
            inner_copies = copies * (2 if used else 1)
            if inner_copies > MAX_COPIES:
                raise _at(located, InputError(TOO_MANY_COPIES))
            lines = [
                self._line(start, [*inner, *rest], len(inner) + used, inner_copies)
                for start, inner in zip(starts, alternatives, strict=True)
            ]
            ends = _different(end for line in lines for end in line.ends)
            if len(ends) == 1:
                break
        then, otherwise = (line.steps for line in lines)
        choice = PlannedChoice(number, located, condition, predicted, then, otherwise, 1 + used)
        return choice, ends

    def _step(self, plan: PlanState, located: LocatedStep, step: Step) -> PlanState:
        """Return ``plan``, which has no actions, with one step. Raises ScriptError."""
        key = id(step), *_situation(plan)
        if key in self._known:
            return self._known[key]
        try:
            after = step.build(plan)
        except InputError as error:
            raise _at(located, self._for_people(error)) from error
        if any(isinstance(action, UntimedPath) for _, action in after.actions):
            self._known[key] = after
        return after

    def _for_people(self, error: InputError) -> InputError:
        """Return ``error`` with its point in the frame of the script, and names for people."""
        if not isinstance(error, PathError):
            return error
        point, frame = error.point, "{S}"
        if self._script.in_base and point:
            T = self._begin.plan_context.T_base_shoulder
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


def _at(located: LocatedStep, error: InputError) -> ScriptError:
    return ScriptError((Problem(located.line, located.column, str(error)),))


def _situation(plan: PlanState) -> tuple[object, ...]:
    """Return a hashable key of everything on which the plans of a step depend."""
    grasp = None if plan.taken is None else plan.taken.at.position.tobytes()
    return Situation.of(plan.state).key, grasp, plan.given_up


def _different(ends: Iterable[PlanState]) -> tuple[PlanState, ...]:
    """Return ``ends`` without those that are the same as one before."""
    different: list[PlanState] = []
    for end in ends:
        if not any(_same(end, other) for other in different):
            different.append(end)
    return tuple(different)


def _same(one: PlanState, other: PlanState) -> bool:
    """Return whether the same step can follow both plans."""
    if Situation.of(one.state).changed_to(Situation.of(other.state)):
        return False
    if one.taken is None or other.taken is None:
        return one.taken is other.taken
    return max(one.taken.at.apart(other.taken.at)) <= EXACT
