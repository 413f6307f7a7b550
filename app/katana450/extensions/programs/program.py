"""A program: a script for one arm as it stands, everything planned before anything moves."""

from __future__ import annotations

from dataclasses import dataclass

from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.bench import Bench, PlanContext
from katana450.extensions.programs.layout import Layout, Report
from katana450.extensions.programs.order import Go, Pace, Task
from katana450.extensions.programs.script import Script
from katana450.maths.geometry.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Program:
    """name: for people. speed: share of full speed. start: (5,) where the arm has to stand [rad].

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
        return sum(task.order.plan.duration for task in self.tasks if isinstance(task.order, Go))


def compiled(
    script: Script,
    rig: PlanContext,
    state: State,
    speed: float = 1.0,
    report: Report = lambda _: None,
) -> Program:
    """``script`` for ``rig`` from where ``state`` has it, at ``speed`` of its own.

    ``report``: given every stage of the planning as it begins. Raises ScriptError with the line of
    the step that cannot be, and why; CancelledError where a checkpoint does.
    """
    if script.bare and rig.arm.gripper.moves:
        raise InputError(
            f"{script.name} is for an arm without its gripper (`gripper: none`). Start the server "
            "with --bare."
        )
    bench = Bench(rig, state)
    bench.state = bench.standing(state.setpoint)
    laid = Layout(script, bench, report).all()
    tasks = [Task(0, 1, "speed", Pace(1.0))]
    for number, (placed, orders) in enumerate(zip(script.steps, laid, strict=True)):
        tasks += [Task(number, placed.line, name, order) for name, order in orders]
    whole = script.speed * speed
    return Program(script.name, whole, state.setpoint, tuple(tasks), len(script.steps))
