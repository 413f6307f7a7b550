"""A stop is cleared at rest and after a pause, and two stops before one tick count as both."""

from __future__ import annotations

import math

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import (
    HOLD_OFF,
    PAUSE_TIMEOUT,
    REPORTED_PRESSES,
    SilenceProfile,
    at_rest,
    clear_refusal,
    joined,
    restarted,
)
from katana450.arm.control.state.messages import finding_text, sentence
from katana450.arm.control.state.state import Finding, Reason, State, Status, Verdict
from katana450.arm.control.state.stop_cause import WATCHDOG, StopCause, pressed
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.velocity import JogFrame
from tests.control.clearing import cleared
from tests.control.test_session import reasons
from tests.ticks import TICK, ticked

ANNA = pressed("Anna", "a", "one", 1.0)
BERT = pressed("Bert", "b", "two", 2.0)


def test_stop_is_not_cleared_while_the_arm_brakes(session: Session, state: State) -> None:
    moving = ticked(session, state, cmd.Joints(np.zeros(5)), ticks=60)
    stopped = ticked(session, moving, cmd.Stop(ANNA), ticks=5)
    assert not stopped.motion.at_rest
    early = ticked(session, stopped, cmd.ClearStop())
    assert early.stopped is not None
    assert early.outcomes[0].verdict is Verdict.REFUSED
    assert "brakes" in early.outcomes[0].why


def test_stop_is_cleared_after_the_pause_that_each_stop_begins(
    session: Session, state: State
) -> None:
    stopped = ticked(session, state, cmd.Stop(ANNA), ticks=60)
    assert "Clear the stop in 0.4 s" in clear_refusal(stopped, stopped.t + 0.01)
    # Another person presses STOP: the pause begins again, the cause stays.
    again = ticked(session, stopped, cmd.Stop(BERT), ticks=60)
    assert again.stopped is not None
    assert again.stopped.cause == ANNA
    assert again.presses == ("one", "two")
    assert ticked(session, again, cmd.ClearStop()).stopped is not None
    late = ticked(session, again, ticks=round((HOLD_OFF - 0.6) / TICK) + 1)
    cleared = ticked(session, late, cmd.ClearStop())
    assert (cleared.stopped, cleared.moving) == (None, False)
    # The presses are known after the end of the stop, so that late copies are recognised.
    assert cleared.presses == ("one", "two")


def test_stop_that_the_giver_does_not_know_is_not_cleared(session: Session, state: State) -> None:
    stopped = ticked(session, state, cmd.Stop(ANNA), ticks=150)
    assert stopped.stopped is not None
    for known in (-math.inf, stopped.stopped.newest - TICK):
        after = ticked(session, stopped, cmd.ClearStop(known))
        assert after.stopped is not None
        assert after.outcomes[0].why.startswith("Anna pressed STOP.")
    assert ticked(session, stopped, cmd.ClearStop(stopped.stopped.newest)).stopped is None


def test_clear_stop_without_a_stop_is_accepted(session: Session, state: State) -> None:
    assert ticked(session, state, cmd.ClearStop()).outcomes[0].verdict is Verdict.ACCEPTED


def test_state_carries_the_newest_presses_alone(session: Session, state: State) -> None:
    for number in range(REPORTED_PRESSES + 3):
        state = ticked(session, state, cmd.Stop(pressed("Anna", "a", str(number), 0.0)))
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
    moving = ticked(session, state, cmd.Joints(np.zeros(5)), cmd.Gripper(0.4), ticks=20)
    assert moving.gripper_setpoint != moving.gripper_goal
    paused = ticked(session, moving, cmd.Pause(), ticks=20)
    assert paused.gripper_setpoint == moving.gripper_setpoint
    stopped = ticked(session, moving, cmd.Stop(ANNA), ticks=150)
    cleared = ticked(session, stopped, cmd.ClearStop(), ticks=20)
    assert cleared.stopped is None
    # They do not continue when the stop is cleared.
    assert cleared.gripper_setpoint == moving.gripper_setpoint


def test_stop_without_a_press_still_counts_when_it_is_joined() -> None:
    both = joined(cmd.Stop(ANNA), cmd.Stop(WATCHDOG))
    assert (both.cause.press, both.presses) == ("", ("one",))
    assert both.cause.why == ANNA.why
    assert joined(cmd.Stop(StopCause()), cmd.Stop(ANNA)).presses == ("one",)


LATE = Finding(Reason.LOOP_LATE, 0.3)


def test_profile_chooses_between_stop_and_pause() -> None:
    stop = cmd.Stop(StopCause(f"{finding_text(LATE)}."), LATE)
    assert SilenceProfile.REAL_ARM.braking(LATE, 0.3) == stop
    assert SilenceProfile.SIMULATION.braking(LATE, 0.3) == cmd.HoldFor(LATE)
    assert SilenceProfile.SIMULATION.braking(LATE, PAUSE_TIMEOUT) == stop
    # A program keeps its path, unless somebody may stand beside the arm.
    assert SilenceProfile.SIMULATION.braking(LATE, 0.3, resumes=True) == cmd.PauseFor(LATE)
    assert SilenceProfile.SIMULATION.braking(LATE, PAUSE_TIMEOUT, resumes=True) == stop
    assert SilenceProfile.REAL_ARM.braking(LATE, 0.3, resumes=True) == stop


def test_pause_by_the_server_keeps_the_path_until_resume(session: Session, state: State) -> None:
    moving = ticked(session, state, cmd.Joint(1, 1.0), ticks=20)
    paused = ticked(session, moving, cmd.PauseFor(LATE), ticks=100)
    assert paused.pause_cause == LATE
    assert not paused.moving
    resumed = ticked(session, paused, cmd.Resume(), ticks=300)
    assert resumed.pause_cause is None
    assert not resumed.findings
    assert resumed.q[0] == 1.0
    # The pause of a person lasts, whether it came before or after.
    for pauses in ([cmd.Pause(), cmd.PauseFor(LATE)], [cmd.PauseFor(LATE), cmd.Pause()]):
        both = ticked(session, moving, *pauses, ticks=100)
        assert both.paused
        assert both.pause_cause is None


def test_resume_moves_nothing_where_a_pause_ended_the_brake_of_a_hold(
    session: Session, state: State
) -> None:
    random = np.random.default_rng(450)
    for _ in range(20):
        away = cmd.Joints(session.ready + random.uniform(-0.5, 0.5, 5))
        braking = ticked(session, ticked(session, state, away), ticks=int(random.integers(5, 40)))
        braking = ticked(
            session, ticked(session, braking, cmd.Hold()), ticks=int(random.integers(1, 8))
        )
        rest = ticked(session, ticked(session, braking, cmd.Pause()), ticks=150)
        assert rest.motion.at_rest
        resumed = ticked(session, ticked(session, rest, cmd.Resume()), ticks=5)
        assert resumed.setpoint.tobytes() == rest.setpoint.tobytes()


@pytest.fixture
def paused(session: Session, state: State) -> State:
    """Return a state after a pause in a motion."""
    moving = ticked(session, state, cmd.Joint(1, 1.0), ticks=20)
    return ticked(session, moving, cmd.HoldFor(LATE), ticks=100)


@pytest.mark.parametrize(
    "command",
    [
        cmd.Joint(1, 1.5),
        cmd.Gripper(0.3),
        cmd.Position(np.array((0.3, 0.0, 0.2))),
        cmd.Hold(),
        cmd.Jog(np.array((0.1, 0.0, 0.0, 0.0, 0.0)), JogFrame.BASE),
    ],
    ids=lambda command: type(command).__name__,
)
def test_paused_arm_rests_until_the_next_command(
    session: Session, paused: State, command: cmd.Command
) -> None:
    assert paused.status is Status.PAUSED
    assert reasons(paused) == {Reason.WAITING, Reason.LOOP_LATE}
    assert not paused.moving
    later = ticked(session, paused, ticks=100)
    np.testing.assert_array_equal(later.q, paused.q)
    assert not ticked(session, later, command).waits


def test_plan_that_begins_elsewhere_keeps_a_pause(
    session: Session, state: State, paused: State
) -> None:
    elsewhere = plan_to(session.require_arm(), None, state, paused.goal)
    for _ in range(2):
        paused = ticked(session, paused, cmd.Follow(elsewhere))
        assert paused.status is Status.PAUSED
        assert reasons(paused) == {Reason.WAITING, Reason.LOOP_LATE, Reason.NOT_AT_START}
        assert len(paused.findings) == 3


@pytest.mark.parametrize("command", [cmd.Speed(0.5), cmd.SetPriority(Priority.PITCH)])
def test_settings_keep_a_pause(session: Session, paused: State, command: cmd.Command) -> None:
    assert ticked(session, paused, command).waits


def test_stop_keeps_its_cause_until_it_is_cleared(session: Session, state: State) -> None:
    moving = ticked(session, state, cmd.Joint(1, 1.0), ticks=20)
    stopped = ticked(session, moving, cmd.Stop(finding=LATE), ticks=100)
    assert reasons(stopped) == {Reason.STOPPED, Reason.LOOP_LATE}
    again = ticked(session, stopped, cmd.Stop())
    assert reasons(again) == {Reason.STOPPED, Reason.LOOP_LATE}
    assert reasons(cleared(session, again)) == set()


def test_restarted_arm_is_stopped_with_the_scene_of_the_kept_state(
    session: Session, state: State
) -> None:
    moving = ticked(session, state, cmd.Speed(0.5), cmd.Joint(1, 1.0), ticks=20)
    assert moving.moving
    rest = at_rest(moving)
    beginning = session.begin(rest.q, rest.gripper, 5.0)
    first = restarted(beginning, rest)
    assert reasons(first) == {Reason.STOPPED, Reason.RESTARTED}
    assert (first.speed, first.objects, first.status) == (0.5, moving.objects, Status.STOPPED)
    later = ticked(session, first, ticks=50)
    np.testing.assert_array_equal(later.q, moving.q)
    cleared = ticked(session, later, cmd.ClearStop(), ticks=50)
    np.testing.assert_array_equal(cleared.q, moving.q)
    assert restarted(beginning, None).stopped is not None


def test_sentence_names_one_way_out_of_two_pauses(session: Session, state: State) -> None:
    moving = ticked(session, state, cmd.Joint(1, 2.0), ticks=20)
    paused = ticked(session, moving, cmd.Pause(), cmd.HoldFor(LATE))
    assert {Reason.PAUSED, Reason.WAITING} <= reasons(paused)
    assert "press Resume" in sentence(paused)
    assert "next command" not in sentence(paused)
