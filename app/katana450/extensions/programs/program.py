"""A program: a script for one arm as it stands, everything planned before anything moves."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.actions import FollowPlan, SetSpeed, Task
from katana450.extensions.programs.compiler import Compiler, Report
from katana450.extensions.programs.plan_builder import PlanBuilder, PlanContext
from katana450.extensions.programs.script import Script
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Program:
    """name: for people. speed: fraction of full speed. start: (5,) where the arm has to stand
    [rad].

    tasks: what is done, in its order. steps: how many steps they belong to.
    """

    name: str
    speed: float
    start: FloatArray
    tasks: tuple[Task, ...]
    steps: int

    @property
    def duration(self) -> float:
        """[s] of all motions at full speed."""
        return sum(
            task.order.plan.duration for task in self.tasks if isinstance(task.order, FollowPlan)
        )


def compiled(
    script: Script,
    plan_context: PlanContext,
    state: State,
    speed: float = 1.0,
    report: Report = lambda _: None,
) -> Program:
    """``script`` for ``rig`` from where ``state`` has it, at ``speed`` of its own.

    ``report``: given every stage of the planning as it begins. Raises ScriptError with the line of
    the step that cannot be, and why; CancelledError where a checkpoint does.
    """
    if script.bare and plan_context.arm.gripper.moves:
        raise InputError(
            f"{script.name} is for an arm without its gripper (`gripper: none`). Start the server "
            "with --bare."
        )
    builder = PlanBuilder(plan_context, state)
    builder.state = builder.standing(state.setpoint)
    laid = Compiler(script, builder, report).all()
    tasks = [Task(0, 1, "speed", SetSpeed(1.0))]
    for number, (placed, orders) in enumerate(zip(script.steps, laid, strict=True)):
        tasks += [Task(number, placed.line, name, order) for name, order in orders]
    whole = script.speed * speed
    return Program(script.name, whole, state.setpoint, tuple(tasks), len(script.steps))
