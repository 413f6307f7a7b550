"""Test the step ``if``: both alternatives are planned, and the measured state chooses one."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.extensions.programs.building.actions import FollowPlan
from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.language.source import ScriptError
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.compiler import MAX_COPIES, Compiler, ConditionalJump
from katana450.extensions.programs.run.program import Program
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.run.simulation import moments
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.server.page_state import marks, planned_steps, steps_of
from tests.programs.conftest import Stage
from tests.ticks import TICK, ticked

HEAD = "frame: base\nsteps:\n"

NESTED = """\
  - if:
      volume: {of: cup, at_least: 50}
      then:
        - nudge: {axis: 5, by: 10}
        - if:
            volume: {of: cup, at_least: 100}
            then:
              - nudge: {axis: 5, by: 20}
  - nudge: {axis: 1, by: 3}
"""
"""Three ends: axis 5 is turned by 0, 10 or 30 deg, and axis 1 by 3 deg afterwards."""


@pytest.fixture(scope="module")
def empty(stage: Stage) -> State:
    """A state with an empty cup."""
    return with_water(stage, 0.0)


@pytest.fixture(scope="module")
def nested(stage: Stage, empty: State) -> Program:
    return planned(stage, NESTED, empty)


def planned(stage: Stage, text: str, state: State) -> Program:
    return stage.planned(HEAD + text, state)


def with_water(stage: Stage, ml: float) -> State:
    return ticked(stage.session, stage.begin(), cmd.Fill(ml))


def turned(state: State, end: State, axis: int) -> float:
    """Return by how many degrees an axis, from 1, has turned."""
    return float(np.degrees(end.setpoint[axis - 1] - state.setpoint[axis - 1]))


def test_steps_are_repeated_until_a_condition_holds(stage: Stage, empty: State) -> None:
    turn = "[{fill: 10}, {nudge: {axis: 5, by: 10}}]"
    text = (
        f"  - repeat: {{times: 4, until: {{volume: {{of: cup, at_least: ML}}}}, steps: {turn}}}\n"
    )
    # A round that is not expected takes no time on the clock of the program.
    for ml, rounds in ((5, 1), (90, 4)):
        program = planned(stage, text.replace("ML", str(ml)), empty)
        _, states = stage.play(program, empty)
        assert turned(empty, states[-1], 5) == pytest.approx(10.0 * rounds, abs=1e-6)
        took = states[-1].t - empty.t
        assert program.duration == pytest.approx(took, abs=0.03 * len(program.tasks))
    for until, why in (("{}", "`until` needs exactly one of"), ("{held: 1}", "Expected a text")):
        with pytest.raises(ScriptError, match=why):
            parse(f"steps:\n  - repeat: {{times: 2, until: {until}, steps: [home]}}\n")


@pytest.mark.parametrize(
    ("ml", "angle", "choices", "skipped"),
    [
        (0.0, 0.0, ((0, False),), (2, 3, 4)),
        (60.0, 10.0, ((0, True), (2, False)), (4,)),
        (120.0, 30.0, ((0, True), (2, True)), ()),
    ],
)
def test_measured_state_chooses_the_alternative(
    stage: Stage,
    nested: Program,
    ml: float,
    angle: float,
    choices: tuple[tuple[int, bool], ...],
    skipped: tuple[int, ...],
) -> None:
    state = with_water(stage, ml)
    run, states = stage.play(nested, state)
    assert (run.phase, run.why) == (Phase.DONE, "")
    assert turned(state, states[-1], 5) == pytest.approx(angle)
    assert turned(state, states[-1], 1) == pytest.approx(3.0)
    assert run.choices == choices
    assert runner.progress(nested, run, states[-1]).skipped == skipped


def test_step_after_different_ends_is_planned_for_each(nested: Program) -> None:
    assert nested.steps == 5
    assert [task.number for task in nested.tasks if isinstance(task.action, FollowPlan)] == [
        1, 3, 4, 4, 4
    ]  # fmt: skip


def test_step_after_the_same_end_is_planned_once(stage: Stage, empty: State) -> None:
    text = (
        "  - if:\n      volume: {of: cup, at_least: 50}\n"
        "      then: [{nudge: {axis: 5, by: 10}}, home]\n"
        "      else: [{nudge: {axis: 5, by: -10}}, {nudge: {axis: 5, by: -10}}, home]\n"
        "  - nudge: {axis: 1, by: 3}\n"
    )
    program = planned(stage, text, empty)
    paths = [task for task in program.tasks if isinstance(task.action, FollowPlan)]
    assert [task.number for task in paths] == [1, 2, 3, 4, 5, 6]
    seconds = [task.action.plan.duration for task in paths if isinstance(task.action, FollowPlan)]
    # One clock: duration, preview and time left are those of the predicted run, here of `else`.
    assert program.duration == pytest.approx(sum(seconds[2:]))
    left = runner.seconds_left(program, Run(0.0), empty)
    assert left == pytest.approx(program.duration)
    full = with_water(stage, 60.0)
    then = planned(stage, text, full)
    shorter = seconds[0] + seconds[1] + seconds[5]
    assert then.duration == pytest.approx(shorter)
    # A run that takes another alternative counts that one as soon as it has chosen.
    choice = program.tasks[1].action
    assert isinstance(choice, ConditionalJump)
    chosen = Run(0.0, number=choice.then)
    assert runner.seconds_left(program, chosen, full) == pytest.approx(shorter)
    run, states = stage.play(program, full)
    assert run.phase is Phase.DONE
    assert turned(empty, states[-1], 1) == pytest.approx(3.0)


def test_list_of_steps_and_preview_show_the_predicted_alternative(
    stage: Stage, nested: Program, empty: State
) -> None:
    steps = steps_of(nested)
    assert [step.name for step in steps] == [
        "if the water in the cup", "then: nudge", "then: if the water in the cup", "then: nudge",
        "nudge",
    ]  # fmt: skip
    assert [step.predicted for step in steps] == [True, False, False, False, True]
    assert all(step.seconds > 0.0 for step in steps if "nudge" in step.name)
    assert nested.preview_time == pytest.approx(steps[4].seconds)
    assert marks(steps, None, 0.5 * nested.preview_time) == ("", "", "", "", "shown")
    *_, last = moments(nested, stage.session, empty)
    assert last.t == pytest.approx(nested.duration)
    # Another alternative than the predicted one is not in the preview.
    *_, last = moments(nested, stage.session, with_water(stage, 60.0))
    assert last.t == 0.0
    state = with_water(stage, 60.0)
    run, states = stage.play(nested, state)
    done = runner.progress(nested, run, states[-1])
    words = marks(steps, done, 0.0)
    assert words == ("done", "done", "done", "skipped", "done")
    planned_marks = {step.name: step.mark for step in planned_steps(steps, done, 0.0)}
    assert planned_marks["then: nudge"] == "skipped"


def test_state_is_measured_when_the_step_is_reached(stage: Stage, empty: State) -> None:
    text = (
        "  - wait: 0.5\n"
        "  - if: {volume: {of: cup, at_least: 50}, then: [{nudge: {axis: 5, by: 10}}]}\n"
    )
    program = planned(stage, text, empty)
    run, state = Run(empty.t), empty
    while run.phase is Phase.RUNNING and state.t < 10.0:
        run, commands = runner.step(program, run, state, state.t)
        if empty.t + 0.2 < state.t < empty.t + 0.2 + 1.5 * TICK:
            commands = (*commands, cmd.Fill(80.0))
        state = stage.session.step(state, commands, state.t + TICK)
        state = stage.session.observe(state, state.setpoint, state.gripper_setpoint)
    assert run.phase is Phase.DONE
    assert turned(empty, state, 5) == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("held: cup", False),
        ("held: basin", False),
        ("volume: {of: basin, at_most: 1}", True),
    ],
)
def test_conditions_are_measured(stage: Stage, empty: State, condition: str, holds: bool) -> None:
    text = f"  - wait: 1\n  - if: {{{condition}, then: [{{wait: 0.1}}], else: [{{wait: 0.2}}]}}\n"
    program = planned(stage, text, empty)
    run, _ = stage.play(program, empty)
    assert run.choices == ((1, holds),)
    action = program.tasks[program.schedule[-1].number].action
    assert action.fraction(empty, 0.1) == (1.0 if holds else 0.5)


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ("held: jug", "no object 'jug'"),
        ("volume: {of: cup, at_least: 3}", "There is no water"),
        ("volume: {of: jug, at_least: 3}", "no object 'jug'"),
    ],
)
def test_condition_that_never_holds_is_refused(stage: Stage, condition: str, said: str) -> None:
    with pytest.raises(ScriptError, match=said):
        planned(stage, f"  - if: {{{condition}, then: [home]}}\n", stage.begin())


def test_alternatives_in_loops(stage: Stage, empty: State) -> None:
    text = """\
let: {limit: 50}
steps:
  - for_each:
      name: by
      in: [2, 4, 5]
      steps:
        - if:
            volume: {of: cup, at_least: limit}
            then: [{nudge: {axis: 5, by: by}}]
            else: [{nudge: {axis: 5, by: -by}}]
"""
    program = stage.planned(text, empty)
    assert program.steps == 9
    for ml, angle in ((0.0, -11.0), (60.0, 11.0)):
        state = with_water(stage, ml)
        run, states = stage.play(program, state)
        assert run.phase is Phase.DONE
        assert turned(state, states[-1], 5) == pytest.approx(angle)


def test_step_by_step_pauses_behind_the_if(stage: Stage, nested: Program) -> None:
    state = with_water(stage, 60.0)
    run = Run(state.t, single=True)
    while not state.paused and run.phase is Phase.RUNNING:
        run, state = stage.tick(nested, run, state)
    assert nested.tasks[run.number].number == 1
    assert runner.progress(nested, run, state).step == 2


def test_number_of_copies_of_a_step_is_bounded(stage: Stage, empty: State) -> None:
    one = "  - if: {volume: {of: cup, at_least: 50}, then: [{nudge: {axis: 5, by: 5}}]}\n"
    home = "  - home\n"
    with pytest.raises(ScriptError, match=f"more than {MAX_COPIES} situations") as refused:
        planned(stage, 5 * one + home, empty)
    assert refused.value.problems[0].line == 7
    begin = PlanState(stage.plan_context, empty)
    assert Compiler(parse(HEAD + 4 * one + home), begin).tasks()
    assert Compiler(parse(HEAD + 8 * (one + home)), begin).tasks()


def test_impossible_step_of_an_alternative_is_refused(stage: Stage, empty: State) -> None:
    text = (
        "  - if:\n      volume: {of: cup, at_least: 3}\n      then: [home]\n"
        "      else:\n        - move: {x: 3, y: 0, z: 5}\n"
    )
    with pytest.raises(ScriptError, match="cannot be") as refused:
        planned(stage, text, empty)
    assert refused.value.problems[0].line == 7
    with pytest.raises(ScriptError, match="no object 'jug'") as refused:
        planned(stage, "  - if: {held: jug, then: [home]}\n", empty)
    assert refused.value.problems[0].line == 3


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("{then: [home]}", "`if` needs exactly one of held, volume\\."),
        ("{held: cup, volume: {of: cup, at_least: 1}, then: [home]}", "exactly one of"),
        ("{held: cup}", "`if` needs 'then'"),
        ("{held: cup, then: []}", "Expected a list of steps"),
        ("{held: cup, then: [home], else: []}", "Expected a list of steps"),
        ("{held: cup, then: [home], otherwise: [home]}", "has no 'otherwise'"),
        ("{held: cup, then: [hme]}", "did you mean 'home'"),
        ("{volume: {of: cup}, then: [home]}", "A volume needs `at_least` or `at_most`"),
        ("{volume: {of: cup, at_least: 3 mm}, then: [home]}", "not a length"),
        ("{volume: 3, then: [home]}", "must be a mapping"),
        ("{volume: {u: 3}, then: [home]}", "A volume has no 'u'"),
        ("held", "must be a mapping"),
    ],
)
def test_mistake_is_refused_with_its_place(value: str, said: str) -> None:
    with pytest.raises(ScriptError, match=said) as refused:
        parse(f"{HEAD}  - if: {value}\n")
    assert refused.value.problems[0].line == 3


def test_steps_of_alternatives_count() -> None:
    inner = ", ".join(["home"] * 30)
    text = f"steps:\n  - repeat: {{times: 40, steps: [{{if: {{held: cup, then: [{inner}]}}}}]}}\n"
    with pytest.raises(ScriptError, match="maximum is 1000"):
        parse(text)
