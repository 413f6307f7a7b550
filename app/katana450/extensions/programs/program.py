"""A program: a script that is planned completely, for one arm in one situation."""

from __future__ import annotations

from dataclasses import dataclass, replace

from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.actions import FollowPlan, SetSpeed, Task
from katana450.extensions.programs.compiler import Compiler, Report
from katana450.extensions.programs.plan_builder import PlanBuilder, PlanContext
from katana450.extensions.programs.script import Script
from katana450.extensions.programs.settings_steps import Speed, Tool
from katana450.extensions.programs.wait_for import WaitUntil
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Program:
    """A compiled script.

    Attributes:
        name: name of the script.
        speed: speed of all motions, as a fraction of full speed.
        start: (5,) posture [rad] from which the program must start.
        tasks: the actions in the order of their execution.
        steps: number of steps of the script.
        first: index of the task with which a run begins; the tasks before it are done or skipped.
    """

    name: str
    speed: float
    start: FloatArray
    tasks: tuple[Task, ...]
    steps: int
    first: int = 0

    @property
    def duration(self) -> float:
        """Duration of all motions of a run at full speed [s]."""
        actions = (task.action for task in self.tasks[self.first :])
        return sum(action.duration for action in actions if isinstance(action, FollowPlan))

    @property
    def conditions(self) -> tuple[Task, ...]:
        """The tasks that wait for a condition."""
        return tuple(task for task in self.tasks if isinstance(task.action, WaitUntil))

    @property
    def rehearsed(self) -> Program:
        """The program for a simulation in which nobody acts: all conditions count as true."""
        tasks = [
            replace(task, action=replace(task.action, assumed=True))
            if isinstance(task.action, WaitUntil)
            else task
            for task in self.tasks
        ]
        return replace(self, tasks=tuple(tasks))


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
        first_step: index of the first step of the program. Of the steps before it only those apply
            that choose the tool frame or the speed.

    Raises:
        ScriptError: a step is not possible; the error has its line.
        InputError: the script needs an arm without gripper, and this arm has one.
        CancelledError: the planning was cancelled.
    """
    if script.bare and plan_context.arm.gripper.moves:
        raise InputError(
            f"{script.name} needs an arm without its gripper (`gripper: none`). Start the server "
            "with --bare."
        )
    builder = PlanBuilder(plan_context, state)
    builder.state = builder.standing(state.setpoint)
    if not 0 <= first_step < len(script.steps):
        raise InputError(
            f"There is no step {first_step + 1}: {script.name} has {len(script.steps)} steps."
        )
    numbered = [
        (number, located)
        for number, located in enumerate(script.steps)
        if number >= first_step or isinstance(located.step, Tool | Speed)
    ]
    taken = replace(script, steps=tuple(located for _, located in numbered))
    compiled_steps = Compiler(taken, builder, report).all()
    tasks = [Task(numbered[0][0], 1, "speed", SetSpeed(1.0))]
    for (number, located), actions in zip(numbered, compiled_steps, strict=True):
        tasks += [Task(number, located.line, name, action) for name, action in actions]
    total_speed = script.speed * speed
    return Program(script.name, total_speed, state.setpoint, tuple(tasks), len(script.steps))
