"""Tests of programs that are interrupted at any time and continued from where the arm stands."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.stopping import HOLD_OFF
from katana450.arm.control.state.scene_objects import SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.run.continuation import RETURN, Interruption, continued
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.server.page_state import steps_of
from katana450.maths.geometry.arrays import FloatArray
from tests.programs.conftest import TICK, Stage
from tests.ticks import rested

SCRIPT = """\
name: Interrupted
tool: tcp
frame: base
steps:
  - speed: 0.8
  - move: {x: 320, y: -40, z: 150, pitch: 50, roll: 0}
  - line: {by: {y: 60}}
  - gripper: open
  - wait: 0.2
  - arc: {centre: {x: 320, y: 20, z: 130}, axis: y, angle: 40, pitch: 60}
"""


@pytest.fixture(scope="module")
def program(stage: Stage) -> Program:
    return stage.planned(SCRIPT)


@pytest.fixture(scope="module")
def whole(stage: Stage, program: Program) -> list[State]:
    """The states of the program that nobody stops."""
    return played(stage, program, stage.begin())


def stopped_after(
    stage: Stage, program: Program, ticks: int, start: State | None = None
) -> tuple[Run, State]:
    """Return the run and the state after a stop at the tick ``ticks``, cleared at rest."""
    state, run = start or stage.begin(), Run(0.0, number=program.first)
    for _ in range(ticks):
        run, state = stage.tick(program, run, state)
    return stop(stage, program, run, state)


def stop(stage: Stage, program: Program, run: Run, state: State) -> tuple[Run, State]:
    """Return the run and the state after a stop that is cleared as soon as that is allowed."""
    state = stage.session.step(state, [cmd.Stop()], state.t + TICK)
    for _ in range(math.ceil(HOLD_OFF / TICK) + 100):
        run, state = stage.tick(program, run, state)
    assert run.phase is Phase.STOPPED
    state = rested(stage.session, state, cmd.ClearStop())
    assert state.stopped is None
    return run, state


def interruption_of(program: Program, run: Run, state: State) -> Interruption:
    interruption = Interruption.of(program, run, state)
    assert interruption is not None
    return interruption


def rest_of(stage: Stage, program: Program, run: Run, state: State) -> Program:
    """Return the program that continues ``run`` from ``state``."""
    return continued(interruption_of(program, run, state), stage.plan_context, state)


def played(stage: Stage, program: Program, state: State, period: float = TICK) -> list[State]:
    """Return the states of the run of ``program``, which must succeed."""
    run, states = stage.play(program, state, period=period)
    assert (run.phase, run.why) == (Phase.DONE, "")
    return states


def off_path(program: Program, states: list[State]) -> float:
    """Return the maximum distance of the postures of ``states`` from the path of ``program``."""
    plans = [task.action.plan for task in program.tasks if isinstance(task.action, FollowPlan)]
    path = np.concatenate([plan.postures(800) for plan in plans])
    return max(float(np.abs(path - state.setpoint).max(axis=1).min()) for state in states[::5])


def after_return(rest: Program, states: list[State]) -> list[State]:
    """Return the ``states`` after the return to the path, with which ``rest`` may begin."""
    way = [task.action for task in rest.tasks if task.name == RETURN]
    if not way:
        return states
    assert isinstance(way[-1], FollowPlan)
    end = way[-1].plan.end
    first = next(n for n, state in enumerate(states) if np.abs(state.setpoint - end).max() < 1e-9)
    return states[first:]


@pytest.mark.parametrize(
    "ticks",
    [30, 140, *(pytest.param(n, marks=pytest.mark.long) for n in range(10, 420, 17))],
)
def test_stopped_program_continues_on_its_path(
    stage: Stage, program: Program, whole: list[State], ticks: int
) -> None:
    run, state = stopped_after(stage, program, min(ticks, len(whole) - 20))
    rest = rest_of(stage, program, run, state)
    states = played(stage, rest, state)
    assert states[-1].setpoint == pytest.approx(whole[-1].setpoint, abs=1e-9)
    assert states[-1].gripper == whole[-1].gripper
    # Where it is safe the arm brakes as hard as it can, which leads it off its path.
    assert off_path(program, states) < 0.1
    assert off_path(program, after_return(rest, states)) < 5e-3
    assert max(stage.loads(states)) <= 1.0 + 1e-6


def test_stopped_twice_it_still_continues(stage: Stage, program: Program) -> None:
    run, state = stopped_after(stage, program, 60)
    rest = rest_of(stage, program, run, state)
    run, state = stopped_after(stage, rest, 25, state)
    again = rest_of(stage, rest, run, state)
    states = played(stage, again, state)
    assert off_path(program, after_return(again, states)) < 5e-3
    assert states[-1].setpoint == pytest.approx(program_end(program), abs=1e-9)


def program_end(program: Program) -> FloatArray:
    last = [task.action for task in program.tasks if isinstance(task.action, FollowPlan)][-1]
    return last.plan.end


def test_arm_that_was_moved_returns_to_its_path_first(stage: Stage, program: Program) -> None:
    run, state = stopped_after(stage, program, 60)
    interruption = interruption_of(program, run, state)
    stood = state.setpoint
    state = rested(stage.session, state, cmd.Joints(stood + np.array([0.3, 0.1, -0.1, 0.2, 0.4])))
    rest = continued(interruption, stage.plan_context, state)
    added = rest.tasks[rest.first : rest.first + 2]
    assert [task.name for task in added] == ["move: speed", RETURN]
    # The list of steps keeps their names.
    assert [step.name for step in steps_of(rest)] == [step.name for step in steps_of(program)]
    assert rest.tasks[rest.first].number == interruption.task.number
    states = played(stage, rest, state)
    assert off_path(program, states[:1]) > 0.3
    assert off_path(program, after_return(rest, states)) < 5e-3
    assert states[-1].setpoint == pytest.approx(program_end(program), abs=1e-9)


def test_tool_frame_of_the_run_is_selected_again(stage: Stage, program: Program) -> None:
    run, state = stopped_after(stage, program, 60)
    interruption = interruption_of(program, run, state)
    state = rested(stage.session, state, cmd.Tool("flange"))
    states = played(stage, continued(interruption, stage.plan_context, state), state)
    assert (states[0].tool, states[-1].tool) == ("flange", "tcp")


@pytest.mark.parametrize("changed", ["gripper", "scene"])
def test_changed_surroundings_are_refused_by_name(
    stage: Stage, program: Program, changed: str
) -> None:
    run, state = stopped_after(stage, program, 60)
    interruption = interruption_of(program, run, state)
    T = np.eye(4)
    T[:3, 3] = (-0.3, 0.3, 0.0)
    commands: dict[str, cmd.Command] = {
        "gripper": cmd.Gripper(stage.plan_context.arm.gripper.upper),
        "scene": cmd.PlaceObject(SceneObject("box", Shape.BOX, (0.05, 0.05, 0.05), T)),
    }
    state = rested(stage.session, state, commands[changed])
    assert changed in interruption.changed_to(state)
    with pytest.raises(InputError, match=changed):
        continued(interruption, stage.plan_context, state)


def test_completed_run_is_no_interruption(stage: Stage, program: Program) -> None:
    run, states = stage.play(program, stage.begin())
    assert Interruption.of(program, run, states[-1]) is None


def test_speed_in_force_applies_to_the_rest(stage: Stage, program: Program) -> None:
    run, state = stopped_after(stage, program, 60)
    rest = rest_of(stage, program, run, state)
    state = replace(state, speed=0.1)
    assert {after.speed for after in played(stage, rest, state)[5:]} == {0.8}
