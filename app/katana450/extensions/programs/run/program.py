"""A program: a script that is planned completely, for one arm in one situation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from katana450.arm.control.state.state import State
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import FollowPlan, SetSpeed, Task, expected_time
from katana450.extensions.programs.building.plan_state import PlanContext, PlanState
from katana450.extensions.programs.building.step import (
    Conditional,
    LocatedStep,
    count,
    numbered,
    titles,
)
from katana450.extensions.programs.language.scope import ScriptFrame
from katana450.extensions.programs.run.compiler import Compiler, ConditionalJump, Report
from katana450.extensions.programs.script.script import Script
from katana450.maths.geometry.arrays import FloatArray


class Alternatives(NamedTuple):
    """The steps of an ``if``, by their indices in the script.

    Attributes:
        number: the step ``if``.
        otherwise: the first step of ``else``; those before it belong to ``then``.
        end: the first step after both.
    """

    number: int
    otherwise: int
    end: int


class ExpectedTask(NamedTuple):
    """A task of the predicted run: its index, and when it begins and ends.

    Attributes:
        number: its index.
        begin, end: expected times since the run began [s].
    """

    number: int
    begin: float
    end: float


@dataclass(frozen=True, eq=False)
class Program:
    """A compiled script.

    Attributes:
        name: name of the script.
        speed: speed of all motions, as a fraction of full speed.
        start: (5,) posture [rad] from which the program must start.
        tasks: the actions in the order of their execution. Those of an ``if`` jump forward. Steps
            after an ``if`` are there once for each situation in which they are planned.
        titles: name, line and column of each step of the script, also of all alternatives.
        alternatives: the alternatives of each ``if``, in their order.
        first: index of the task with which a run begins.
    """

    name: str
    speed: float
    start: FloatArray
    tasks: tuple[Task, ...]
    titles: tuple[tuple[str, int, int], ...]
    alternatives: tuple[Alternatives, ...] = ()
    first: int = 0

    @cached_property
    def idle(self) -> tuple[int, ...]:
        """Indices of the steps without a task: before the first one, or with nothing to do."""
        return tuple(sorted(set(range(self.steps)) - {task.number for task in self.tasks[1:]}))

    @property
    def steps(self) -> int:
        """The number of steps."""
        return len(self.titles)

    def next(self, number: int, state: State | None = None) -> int:
        """Return the task that follows the task ``number`` in ``state``; None: as predicted.

        The number of tasks stands for the end.
        """
        task = self.tasks[number]
        if isinstance(task.action, ConditionalJump):
            jump = task.action
            holds = jump.predicted if state is None else jump.condition.holds(state)
            return jump.then if holds else jump.otherwise
        return number + 1 if task.after is None else task.after

    @cached_property
    def schedule(self) -> tuple[ExpectedTask, ...]:
        """The predicted run from its first task, at the speeds of the program."""
        return self.expected(self.first, self.speed)

    @property
    def duration(self) -> float:
        """Expected duration [s] of the predicted run, at the speeds of the program."""
        return self.schedule[-1].end

    @property
    def preview_time(self) -> float:
        """The duration [s] of its preview; 0 without a motion, and if it continues a run."""
        actions = (self.tasks[task.number].action for task in self.schedule)
        moves = any(isinstance(action, FollowPlan) for action in actions)
        return self.duration if moves and not self.first else 0.0

    def expected(
        self,
        number: int,
        speed: float,
        *,
        begin: float = 0.0,
        left: float | None = None,
        allowed: float = 1.0,
    ) -> tuple[ExpectedTask, ...]:
        """Return the tasks of the predicted run from the task ``number``, in their order.

        This is the one clock of a program: of its preview, its list of steps and its time left.

        Args:
            number: index of the task.
            speed: fraction of full speed, until a task sets another.
            begin: time since the run began [s].
            left: expected time to the end of the task itself [s], if it has begun.
            allowed: maximum fraction of full speed that a task may set.
        """
        tasks: list[ExpectedTask] = []
        while number < len(self.tasks):
            action = self.tasks[number].action
            if isinstance(action, SetSpeed):
                speed = min(action.scale(self.speed), allowed)
            end = begin + (expected_time(action, speed) if left is None else left)
            tasks.append(ExpectedTask(number, begin, end))
            begin, left = end, None
            number = self.next(number)
        return tuple(tasks)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on the times of the script that its plans cannot keep."""
        return tuple(
            f"Line {task.line}, {task.name}: {task.action.note}"
            for task in self.tasks
            if isinstance(task.action, FollowPlan) and task.action.note
        )


def compiled(
    script: Script,
    plan_context: PlanContext,
    state: State,
    speed: float = 1.0,
    report: Report = lambda _: None,
    first_step: int = 0,
) -> Program:
    """Return ``script`` compiled to a program that starts from ``state``.

    Args:
        script: the script.
        plan_context: the arm and its environment.
        state: the state before the program: posture, fingers, tool frame, scene and water.
        speed: fraction of the speed that the script sets.
        report: function that is called with each stage of the planning as it begins.
        first_step: index of the first step of the program, see ``Compiler.tasks``.

    Raises:
        ScriptError: a step is not possible; the error has its line.
        InputError: the script needs an arm without gripper, and this arm has one.
        CancelledError: the planning was cancelled.
    """
    if script.bare and plan_context.arm.gripper.moves:
        raise InputError(
            f"{script.name} needs an arm without its gripper (`gripper: none`). This server was "
            "started with the gripper."
        )
    frame = ScriptFrame.of(plan_context.T_base_shoulder, in_base=script.in_base)
    plan = PlanState(plan_context, state, frame).standing(state.setpoint)
    tasks = Compiler(script, plan, report).tasks(first_step)
    total_speed = script.speed * speed
    names, alternatives = tuple(titles(script.steps)), tuple(_alternatives(script.steps, 0))
    return Program(script.name, total_speed, state.setpoint, tasks, names, alternatives)


def _alternatives(steps: Sequence[LocatedStep], first: int) -> Iterator[Alternatives]:
    """Yield the alternatives of each ``if`` of ``steps``, which are numbered from ``first``."""
    for number, located in numbered(steps, first):
        step = located.step
        if isinstance(step, Conditional):
            otherwise = number + 1 + count(step.then)
            yield Alternatives(number, otherwise, otherwise + count(step.otherwise))
            yield from _alternatives(step.then, number + 1)
            yield from _alternatives(step.otherwise, otherwise)
