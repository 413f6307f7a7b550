"""Test the step ``wait_for``: its conditions, its timeout, and its simulation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.scene_objects import named
from katana450.arm.control.state import State
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.program import Program, compiled
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.run.simulation import Timeline, moments
from katana450.extensions.programs.script.script import parse
from tests.programs.conftest import TICK, Stage

HEAD = "frame: base\nsteps:\n"


def planned(stage: Stage, text: str, state: State | None = None) -> Program:
    return compiled(parse(HEAD + text), stage.plan_context, state or stage.begin())


def run_with(
    stage: Stage, program: Program, state: State, given: cmd.Command, after: float, most: float
) -> tuple[Run, State]:
    """Run ``program``; somebody gives a command ``after`` [s], for at most ``most`` [s]."""
    run, at = Run(state.t), state.t + after
    while run.phase is Phase.RUNNING and state.t < most:
        run, commands = runner.step(program, run, state, state.t)
        if state.t < at <= state.t + TICK:
            commands = (*commands, given)
        state = stage.session.step(state, commands, state.t + TICK)
        state = stage.session.observe(state, state.setpoint, state.gripper_setpoint)
    return run, state


def test_program_goes_on_once_the_object_is_there(stage: Stage) -> None:
    text = (
        "  - wait_for: {placed: {object: cup, at: [300, 100, 0], within: 5}, timeout: 20}\n"
        "  - nudge: {axis: 5, by: 10}\n"
    )
    state = stage.begin()
    cup = named(state.objects, "cup")
    assert cup is not None
    T = cup.T.copy()
    T[:3, 3] = (0.303, 0.1, 0.0)
    given = cmd.PlaceObject(replace(cup, T=T))
    program = planned(stage, text)
    run, end = run_with(stage, program, state, given, after=3.0, most=30.0)
    assert run.phase is Phase.DONE
    assert end.t > 3.0
    assert np.degrees(end.q[4] - state.q[4]) == pytest.approx(10.0)


def test_program_fails_at_its_line_after_the_timeout(stage: Stage) -> None:
    program = planned(stage, "  - home\n  - wait_for: {held: cup, timeout: 500 ms}\n  - home\n")
    run, end = run_with(stage, program, stage.begin(), cmd.EndDrag(), after=9.0, most=30.0)
    assert run.phase is Phase.FAILED
    assert run.why == ("Line 4, wait for cup in the hand: The condition did not hold within 0.5 s.")
    assert end.t == pytest.approx(0.5, abs=0.1)


def test_conditions_are_measured(stage: Stage) -> None:
    state = stage.begin()
    state = stage.session.step(state, (cmd.Fill(100.0),), state.t + TICK)
    state = stage.session.observe(state, state.setpoint, state.gripper_setpoint)
    for condition, holds in (
        ("volume: {of: cup, at_least: 99.9}", True),
        ("volume: {of: cup, at_least: 50, at_most: 99}", False),
        ("volume: {of: basin, at_most: 1}", True),
        ("gripper: {at_most: 1}", True),
        ("gripper: {at_least: 1}", False),
        ("held: cup", False),
        ("placed: {object: basin, at: [0, 0, 0]}", False),
    ):
        program = planned(stage, f"  - wait_for: {{{condition}}}\n", state)
        (task,) = program.conditions
        assert task.action.done(state, 0.0) is holds, condition


def test_simulation_takes_conditions_for_true(stage: Stage) -> None:
    program = planned(stage, "  - wait_for: {held: cup}\n  - nudge: {axis: 5, by: 10}\n")
    run, states = stage.play(program.rehearsed, stage.begin())
    assert run.phase is Phase.DONE
    assert states[-1].t < 10.0
    *_, last = moments(program, Timeline.of(program), stage.session, stage.begin())
    assert last.state.q == pytest.approx(states[-1].q)


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("{timeout: 3}", "needs exactly one of held, placed, volume, gripper"),
        ("{held: cup, gripper: {at_most: 1}}", "exactly one"),
        ("{hold: cup}", "did you mean 'held'"),
        ("{held: cup, timeout: 0}", "not between"),
        ("{volume: {of: cup}}", "A volume needs `at_least` or `at_most`"),
        ("{placed: {object: cup}}", "needs 'at'"),
        ("held", "mapping of names to values"),
    ],
)
def test_mistake_is_refused_with_its_place(value: str, said: str) -> None:
    with pytest.raises(ScriptError, match=said) as refused:
        parse(f"{HEAD}  - wait_for: {value}\n")
    assert refused.value.problems[0].line == 3


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("{held: jug}", "no object 'jug'"),
        ("{volume: {of: cup, at_least: 3}}", "There is no water"),
        ("{volume: {of: jug, at_least: 3}}", "no object 'jug'"),
    ],
)
def test_condition_that_never_holds_is_refused(stage: Stage, value: str, said: str) -> None:
    with pytest.raises(ScriptError, match=said):
        planned(stage, f"  - wait_for: {value}\n")
