"""A pause and a stop by the server, and the first state after a restart."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.messages import finding_text
from katana450.arm.control.plans import plan_to
from katana450.arm.control.restart import at_rest, restarted
from katana450.arm.control.session import Session
from katana450.arm.control.silence import PAUSE_TIMEOUT, SilenceProfile
from katana450.arm.control.state import Finding, Reason, State, Status
from katana450.arm.control.stop_cause import StopCause
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.velocity import JogFrame
from tests.control.clearing import cleared
from tests.control.test_session import reasons, run

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
    moving = run(session, state, [cmd.Joint(1, 1.0)], ticks=20)
    paused = run(session, moving, [cmd.PauseFor(LATE)], ticks=100)
    assert paused.pause_cause == LATE
    assert not paused.moving
    resumed = run(session, paused, [cmd.Resume()], ticks=300)
    assert resumed.pause_cause is None
    assert not resumed.findings
    assert resumed.q[0] == 1.0
    # The pause of a person lasts, whether it came before or after.
    for pauses in ([cmd.Pause(), cmd.PauseFor(LATE)], [cmd.PauseFor(LATE), cmd.Pause()]):
        both = run(session, moving, pauses, ticks=100)
        assert both.paused
        assert both.pause_cause is None


@pytest.fixture
def paused(session: Session, state: State) -> State:
    """Return a state after a pause in a motion."""
    moving = run(session, state, [cmd.Joint(1, 1.0)], ticks=20)
    return run(session, moving, [cmd.HoldFor(LATE)], ticks=100)


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
    later = run(session, paused, [], ticks=100)
    np.testing.assert_array_equal(later.q, paused.q)
    assert not run(session, later, [command]).waits


def test_plan_that_begins_elsewhere_keeps_a_pause(
    session: Session, state: State, paused: State
) -> None:
    elsewhere = plan_to(session.require_arm(), None, state, paused.goal)
    for _ in range(2):
        paused = run(session, paused, [cmd.Follow(elsewhere)])
        assert paused.status is Status.PAUSED
        assert reasons(paused) == {Reason.WAITING, Reason.LOOP_LATE, Reason.NOT_AT_START}
        assert len(paused.findings) == 3


@pytest.mark.parametrize("command", [cmd.Speed(0.5), cmd.SetPriority(Priority.PITCH)])
def test_settings_keep_a_pause(session: Session, paused: State, command: cmd.Command) -> None:
    assert run(session, paused, [command]).waits


def test_stop_keeps_its_cause_until_it_is_cleared(session: Session, state: State) -> None:
    moving = run(session, state, [cmd.Joint(1, 1.0)], ticks=20)
    stopped = run(session, moving, [cmd.Stop(finding=LATE)], ticks=100)
    assert reasons(stopped) == {Reason.STOPPED, Reason.LOOP_LATE}
    again = run(session, stopped, [cmd.Stop()])
    assert reasons(again) == {Reason.STOPPED, Reason.LOOP_LATE}
    assert reasons(cleared(session, again)) == set()


def test_restarted_arm_is_stopped_with_the_scene_of_the_kept_state(
    session: Session, state: State
) -> None:
    moving = run(session, state, [cmd.Speed(0.5), cmd.Joint(1, 1.0)], ticks=20)
    assert moving.moving
    kept = at_rest(moving)
    begun = session.begin(kept.q, kept.gripper, 5.0)
    first = restarted(begun, kept)
    assert reasons(first) == {Reason.STOPPED, Reason.RESTARTED}
    assert (first.speed, first.objects, first.status) == (0.5, moving.objects, Status.STOPPED)
    later = run(session, first, [], ticks=50)
    np.testing.assert_array_equal(later.q, moving.q)
    cleared = run(session, later, [cmd.ClearStop()], ticks=50)
    np.testing.assert_array_equal(cleared.q, moving.q)
    assert restarted(begun, None).stopped is not None
