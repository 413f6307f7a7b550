"""The step ``grip``: fingers close until they press with a force, or the script says why not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.errors import InputError
from katana450.extensions.programs.run import runner
from katana450.extensions.programs.run.program import compiled
from katana450.extensions.programs.run.runner import Phase, Run
from katana450.extensions.programs.script.script import parse
from katana450.extensions.programs.steps.settings_steps import CloseUntil
from katana450.extensions.touch.solid_body import DENSITY, FRICTION
from katana450.extensions.touch.touch_model import TouchModel
from katana450.maths.water.units import GRAVITY
from tests.programs.conftest import TICK, Stage
from tests.programs.test_pick_place import NEAR, box, planned

WEIGHT = DENSITY * 0.04 * 0.04 * 0.06 * GRAVITY
"""[N] Weight of the box."""


@pytest.fixture(scope="module")
def holding(stage: Stage) -> State:
    """The state with a box in the closed fingers, on the table."""
    program, start = planned(stage, "- grasp: part\n", box("part", NEAR))
    run, states = stage.play(program, start)
    assert run.phase is Phase.DONE
    return states[-1]


def force(stage: Stage, state: State) -> float:
    """Return the force of a finger [N]."""
    hand = stage.session.environment.hand
    assert hand is not None
    assert isinstance(hand.grip_model, TouchModel)
    found = hand.grip_model.squeeze(state)
    assert found is not None
    return found.force


def play(stage: Stage, steps: str, state: State) -> tuple[Run, State]:
    """Run ``steps`` from ``state``; return the run and the last state."""
    program = compiled(parse(f"frame: base\nsteps:\n{steps}"), stage.plan_context, state)
    run, states = stage.play(program, state)
    return run, states[-1]


@pytest.mark.cases(1)
@pytest.mark.parametrize(("until", "wanted"), [("3 N", 3.0), ("0.8", 0.8)])
def test_fingers_close_until_the_force_is_reached(
    stage: Stage, holding: State, until: str, wanted: float
) -> None:
    run, end = play(stage, f"- grip: {{until: {until}, holding: part}}\n", holding)
    assert run.phase is Phase.DONE
    assert end.held is not None
    assert force(stage, end) == pytest.approx(wanted, rel=0.02)


def test_open_fingers_around_an_object_close_on_it(stage: Stage, holding: State) -> None:
    opened = play(stage, "- gripper: open\n", holding)[1]
    assert opened.held is None
    run, end = play(stage, "- grip: {until: 2 N}\n", opened)
    assert run.phase is Phase.DONE
    assert force(stage, end) == pytest.approx(2.0, rel=0.02)


def test_force_is_corrected_on_a_thicker_object_than_planned(stage: Stage, holding: State) -> None:
    opened = play(stage, "- gripper: open\n", holding)[1]
    program = compiled(parse("steps:\n- grip: {until: 2 N}\n"), stage.plan_context, opened)
    thicker = tuple(replace(each, size=(0.041, 0.041, 0.06)) for each in opened.objects)
    run, state = Run(opened.t), replace(opened, objects=thicker)
    forces = []
    while run.phase is Phase.RUNNING and state.t < opened.t + 20.0:
        run, state = stage.tick(program, run, state)
        forces += [force(stage, state)] if state.held is not None else []
    assert run.phase is Phase.DONE
    # As planned, the fingers would press far more on it.
    assert forces[0] > 2.5
    assert forces[-1] == pytest.approx(2.0, rel=0.02)


def test_object_slides_in_a_weak_grip_and_the_program_ends_for_that(
    stage: Stage, holding: State
) -> None:
    enough = WEIGHT / (2.0 * FRICTION)
    steps = "- grip: {{until: {}}}\n- line: {{by: {{z: 20}}}}\n"
    run, end = play(stage, steps.format(1.5 * enough), holding)
    assert run.phase is Phase.DONE
    assert end.held is not None
    run, end = play(stage, steps.format(0.9 * enough), holding)
    assert run.phase is Phase.FAILED
    assert run.why.startswith("Line 4, line: Part slides in the fingers under a load of 0.5 N")
    assert end.held is not None


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("{until: 11 N}", "The motor of the gripper presses with at most 10 N, not 11 N"),
        ("{until: 3 N, holding: cup}", "would hold part instead of cup"),
        ("{until: 3 mm}", "Expected a number in N, not a length: '3 mm'"),
        ("{until: 0}", "0 is not between 0.1 and 100 N"),
        ("3 N", "A grip must be a mapping"),
    ],
)
def test_impossible_grips_are_refused_before_anything_moves(
    stage: Stage, holding: State, step: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        play(stage, f"- grip: {step}\n", holding)


def test_grip_without_an_object_is_refused_and_fails_at_run_time(
    stage: Stage, holding: State
) -> None:
    opened = play(stage, "- gripper: open\n", holding)[1]
    with pytest.raises(InputError, match="close without an object between them"):
        play(stage, "- grip: {until: 3 N}\n", replace(opened, objects=()))
    program = compiled(parse("steps:\n- grip: {until: 2 N}\n"), stage.plan_context, opened)
    run, state = Run(opened.t), opened
    run, commands = runner.step(program, run, state, state.t)
    state = stage.session.step(state, (cmd.Remove("part"), *commands), state.t + TICK)
    state = stage.session.observe(state, state.setpoint, state.gripper_setpoint)
    while run.phase is Phase.RUNNING and state.t < opened.t + 20.0:
        run, state = stage.tick(program, run, state)
    assert run.phase is Phase.FAILED
    assert "closed on nothing instead of part" in run.why


@pytest.mark.parametrize("room", [1e-3, 0.0])
def test_object_that_is_too_thin_at_run_time_ends_it_at_once(
    stage: Stage, holding: State, room: float
) -> None:
    program = compiled(parse("steps:\n- grip: {until: 9 N}\n"), stage.plan_context, holding)
    (action,) = (task.action for task in program.tasks if isinstance(task.action, CloseUntil))
    assert action.correction(holding)
    # As if the fingers had closed on it near the end of their range, or there.
    assert holding.grip is not None
    end = replace(action, gripper=replace(action.gripper, closed=holding.grip - room))
    with pytest.raises(InputError, match=r"part is too thin: .* before they press with 9 N"):
        end.correction(holding)


def test_gripper_without_known_pads_is_refused(stage: Stage, holding: State) -> None:
    session = stage.session
    hand = session.environment.hand
    assert hand is not None
    session.environment.hand = replace(hand, grip_model=None)
    try:
        with pytest.raises(InputError, match="pads of this gripper are not known"):
            play(stage, "- grip: {until: 3 N}\n", holding)
    finally:
        session.environment.hand = hand
