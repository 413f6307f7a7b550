"""A stop is cleared at rest and after a pause, and two stops before one tick count as both."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.session import Session
from katana450.arm.control.state import State, Verdict
from katana450.arm.control.stop_cause import WATCHDOG, StopCause, pressed
from katana450.arm.control.stopping import HOLD_OFF, REPORTED_PRESSES, clear_refusal, joined

TICK = 0.01
ANNA = pressed("Anna", "a", "one", 1.0)
BERT = pressed("Bert", "b", "two", 2.0)


def run(session: Session, state: State, *commands: cmd.Command, ticks: int = 1) -> State:
    for number in range(ticks):
        state = session.step(state, commands if number == 0 else (), state.t + TICK)
        state = session.observe(state, state.setpoint, state.gripper_setpoint)
    return state


def test_stop_is_not_cleared_while_the_arm_brakes(session: Session, state: State) -> None:
    moving = run(session, state, cmd.Joints(np.zeros(5)), ticks=60)
    stopped = run(session, moving, cmd.Stop(ANNA), ticks=5)
    assert not stopped.motion.at_rest
    early = run(session, stopped, cmd.ClearStop())
    assert early.stopped is not None
    assert early.outcomes[0].verdict is Verdict.REFUSED
    assert "brakes" in early.outcomes[0].why


def test_stop_is_cleared_after_the_pause_that_each_stop_begins(
    session: Session, state: State
) -> None:
    stopped = run(session, state, cmd.Stop(ANNA), ticks=60)
    assert "Clear the stop in 0.4 s" in clear_refusal(stopped, stopped.t + 0.01)
    # Another person presses STOP: the pause begins again, the cause stays.
    again = run(session, stopped, cmd.Stop(BERT), ticks=60)
    assert again.stopped is not None
    assert again.stopped.cause == ANNA
    assert again.presses == ("one", "two")
    assert run(session, again, cmd.ClearStop()).stopped is not None
    late = run(session, again, ticks=round((HOLD_OFF - 0.6) / TICK) + 1)
    cleared = run(session, late, cmd.ClearStop())
    assert (cleared.stopped, cleared.moving) == (None, False)
    # The presses are known after the end of the stop, so that late copies are recognised.
    assert cleared.presses == ("one", "two")


def test_stop_that_the_giver_does_not_know_is_not_cleared(session: Session, state: State) -> None:
    stopped = run(session, state, cmd.Stop(ANNA), ticks=150)
    assert stopped.stopped is not None
    for known in (-math.inf, stopped.stopped.newest - TICK):
        after = run(session, stopped, cmd.ClearStop(known))
        assert after.stopped is not None
        assert after.outcomes[0].why.startswith("Anna pressed STOP.")
    assert run(session, stopped, cmd.ClearStop(stopped.stopped.newest)).stopped is None


def test_clear_stop_without_a_stop_is_accepted(session: Session, state: State) -> None:
    assert run(session, state, cmd.ClearStop()).outcomes[0].verdict is Verdict.ACCEPTED


def test_state_carries_the_newest_presses_alone(session: Session, state: State) -> None:
    for number in range(REPORTED_PRESSES + 3):
        state = run(session, state, cmd.Stop(pressed("Anna", "a", str(number), 0.0)))
    assert state.presses == tuple(str(number) for number in range(3, REPORTED_PRESSES + 3))


@pytest.mark.parametrize("second", [cmd.Stop(BERT), cmd.Stop(BERT, others=("three",))])
def test_joined_stops_have_all_presses_and_the_first_cause(second: cmd.Stop) -> None:
    both = joined(cmd.Stop(ANNA), second)
    assert both.cause == ANNA
    assert both.presses == ("one", *second.presses)


def test_joined_stops_keep_the_newest_presses() -> None:
    presses = tuple(str(number) for number in range(REPORTED_PRESSES + 2))
    both = joined(cmd.Stop(ANNA, others=presses[:2]), cmd.Stop(BERT, others=presses[2:]))
    assert both.others == presses[2:]


def test_fingers_rest_after_a_stop_and_during_a_pause(session: Session, state: State) -> None:
    moving = run(session, state, cmd.Joints(np.zeros(5)), cmd.Gripper(0.4), ticks=20)
    assert moving.gripper_setpoint != moving.gripper_goal
    paused = run(session, moving, cmd.Pause(), ticks=20)
    assert paused.gripper_setpoint == moving.gripper_setpoint
    stopped = run(session, moving, cmd.Stop(ANNA), ticks=150)
    cleared = run(session, stopped, cmd.ClearStop(), ticks=20)
    assert cleared.stopped is None
    # They do not continue when the stop is cleared.
    assert cleared.gripper_setpoint == moving.gripper_setpoint


def test_stop_without_a_press_still_counts_when_it_is_joined() -> None:
    both = joined(cmd.Stop(ANNA), cmd.Stop(WATCHDOG))
    assert (both.cause.press, both.presses) == ("", ("one",))
    assert both.cause.why == ANNA.why
    assert joined(cmd.Stop(StopCause()), cmd.Stop(ANNA)).presses == ("one",)
