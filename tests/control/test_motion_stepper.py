"""Stop, pause, speed and jog of the arm, on which a person has to rely."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import Reason, State, Status
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body
from katana450.maths.motion.limiter import JointMotion, Limiter

TICK = 0.01
FAR = np.array([2.0, -0.4, 0.6, 0.8, -1.5])


def run(session: Session, state: State, commands: Iterable[cmd.Command], ticks: int = 1) -> State:
    commands = list(commands)
    for _ in range(ticks):
        before, state = state, session.step(state, commands, state.t + TICK)
        check(session, before.motion, state.motion)
        commands = []
    return state


def check(session: Session, before: JointMotion, after: JointMotion) -> None:
    limits, slack = session.require_arm().limits, 1.0 + 1e-6
    assert (np.abs(after.qd) <= limits.speed * slack).all()
    assert (np.abs(after.qd - before.qd) <= limits.acceleration * TICK * slack + 1e-8).all()
    assert (np.abs(after.qdd - before.qdd) <= limits.jerk * TICK * slack + 1e-7).all()


def speed(chain: Chain, motion: JointMotion) -> float:
    return float(np.linalg.norm(jacobian_body(chain, motion.q)[3:] @ motion.qd))


def point(chain: Chain, q: FloatArray) -> FloatArray:
    return forward(chain, q)[:3, 3]


def test_stop_brings_the_arm_to_rest_and_reports_its_distance(
    session: Session, state: State
) -> None:
    chain = session.require_arm().chain
    moving = run(session, state, [cmd.Joints(FAR)], 60)
    assert speed(chain, moving.motion) > 0.1
    stopped = run(session, moving, [cmd.Stop()])
    assert stopped.status is Status.STOPPED
    (finding,) = stopped.findings
    assert finding.reason is Reason.STOPPED
    ticks = 1
    while stopped.moving:
        # The arm brakes from the first tick on.
        before, stopped = stopped, run(session, stopped, [])
        assert speed(chain, stopped.motion) <= speed(chain, before.motion) + 0.05
        ticks += 1
    assert stopped.motion.at_rest
    assert ticks * TICK == pytest.approx(finding.time, abs=2 * TICK)
    way = math.dist(point(chain, moving.setpoint), point(chain, stopped.setpoint))
    assert finding.amount == pytest.approx(way, abs=1e-4)
    assert stopped.findings == (finding,)


def test_stop_overrides_motion_in_the_same_tick(session: Session, state: State) -> None:
    batches: list[list[cmd.Command]] = [
        [cmd.Stop(), cmd.Joints(FAR)],
        [cmd.Joints(FAR), cmd.Stop()],
    ]
    for batch in batches:
        after = run(session, state, batch, 100)
        assert (after.setpoint == state.setpoint).all()
        assert after.status is Status.STOPPED


def test_second_stop_leaves_the_brake_as_it_is(session: Session, state: State) -> None:
    moving = run(session, state, [cmd.Joints(FAR)], 60)
    once = run(session, moving, [cmd.Stop()], 20)
    twice = run(session, once, [cmd.Stop()])
    assert twice.findings == once.findings
    assert twice.stopped is not None
    assert once.stopped is not None
    # Only the time until it may be cleared begins again.
    assert replace(twice.stopped, newest=once.stopped.newest) == once.stopped
    assert twice.stopped.newest > once.stopped.newest


def test_pause_stays_on_the_path_and_resume_continues(session: Session, state: State) -> None:
    start = state.setpoint
    moving = run(session, state, [cmd.Joints(FAR)], 60)
    paused = run(session, moving, [cmd.Pause()], 150)
    assert paused.status is Status.PAUSED
    assert not paused.moving
    assert (paused.setpoint != paused.goal).any()
    way = FAR - start
    for q in (moving.setpoint, paused.setpoint):
        fraction = (q - start) @ way / (way @ way)
        assert np.allclose(q, start + fraction * way, atol=1e-9)
    again = run(session, paused, [cmd.Resume()], 400)
    assert (again.setpoint == FAR).all()
    assert again.findings == ()
    # A command during the pause takes effect on Resume.
    redirected = run(session, paused, [cmd.Home()], 50)
    assert (redirected.setpoint == paused.setpoint).all()
    assert {f.reason for f in redirected.findings} == {Reason.PAUSED}
    assert (run(session, redirected, [cmd.Resume()], 400).setpoint == session.ready).all()


@pytest.mark.parametrize("command", [cmd.Pause(), cmd.Stop(), cmd.Resume()])
def test_elbow_that_is_too_fast_for_its_branch_brakes_beyond_it(
    session: Session, state: State, command: cmd.Command
) -> None:
    # A new goal on the old branch came while the elbow was about to pass the stretched arm.
    q, qd = np.array(state.setpoint), np.zeros(5)
    q[2], qd[2] = 0.002, -0.4
    goal = q + np.array([0.0, 0.0, 0.5, 0.0, 0.0])
    beginning = run(session, state, [cmd.Joints(goal)])
    moving = replace(beginning, motion=JointMotion(frozen(q), frozen(qd), frozen(np.zeros(5))))
    assert moving.branch.elbow == state.branch.elbow  # type: ignore[union-attr]
    after = session.step(moving, [command], moving.t + TICK)
    check(session, moving.motion, after.motion)
    travelled, expected = after.motion.q - q, 0.5 * TICK * (qd + after.motion.qd)
    np.testing.assert_allclose(travelled, expected, rtol=0.0, atol=1e-4)


def test_speed_scale_applies_at_once_to_every_joint(session: Session, state: State) -> None:
    moving = run(session, state, [cmd.Joints(FAR)], 70)
    slow = run(session, moving, [cmd.Speed(0.1)], 120)
    limits = session.require_arm().limits
    assert (np.abs(slow.motion.qd) <= 0.1 * limits.speed * (1 + 1e-9)).all()
    assert (np.abs(slow.motion.qd) / limits.speed).max() > 0.09
    fast = run(session, slow, [cmd.Speed(1.0)], 600)
    assert (fast.setpoint == FAR).all()


def test_jog_without_renewal_ends(session: Session, state: State) -> None:
    jog = cmd.Jog(np.array([-0.15, 0.0, 0.0, 0.0, 0.0]))
    held = state
    for _ in range(30):
        held = run(session, held, [jog])
    until = held.t + cmd.JOG_TIME
    while held.t < until:
        held = run(session, held, [])
    assert speed(session.require_arm().chain, held.motion) > 0.05
    # Then it brakes approximately as fast as it can.
    fastest = Limiter(session.require_arm().limits).stopping_time(held.motion)
    while held.moving:
        held = run(session, held, [])
    assert held.t <= until + 1.2 * fastest + 3 * TICK
    assert (held.setpoint == held.goal).all()
    assert held.jogging is None
    assert held.findings == ()


def test_jog_beside_a_limit_never_reverses(session: Session) -> None:
    """From the stretched arm axis 2 soon reaches its limit, and the wrist has to compensate."""
    chain = session.require_arm().chain
    state = session.begin(np.zeros(5), 0.0, 0.0)
    height = point(chain, state.setpoint)[2]
    for _ in range(160):
        state = run(session, state, [cmd.Jog(np.array([0.0, 0.0, -0.25, 0.0, 0.0]))])
        before, height = height, point(chain, state.setpoint)[2]
        assert height < before + 1e-5
    assert state.setpoint[1] == pytest.approx(chain.upper[1], abs=2e-3)
    assert height < -0.1


@pytest.mark.parametrize(
    ("q", "rates", "expected"),
    [
        ([0.0] * 5, [-0.2, 0.0, 0.0, 0.0, 0.0], (Reason.SINGULAR, None)),
        ([0.0] * 5, [0.0, 0.2, 0.0, 0.0, 0.0], None),
        ([0.0, -1.2, 1.6, 0.3, 3.0], [0.0, 0.0, 0.0, 0.0, 0.5], (Reason.AXIS_LIMIT, 4)),
        ([0.0, -1.2, 1.6, 0.3, 3.0], [0.0, 0.0, 0.0, 0.0, -0.5], None),
    ],
)
def test_blocked_jog_reports_its_cause(
    session: Session, q: list[float], rates: list[float], expected: tuple[Reason, int | None] | None
) -> None:
    state = session.begin(session.require_arm().chain.clamp(np.array(q)), 0.0, 0.0)
    for _ in range(30):
        state = run(session, state, [cmd.Jog(np.array(rates))])
    assert [(f.reason, f.axis) for f in state.findings] == ([] if expected is None else [expected])
    assert state.moving
    # The end of the jog clears the finding.
    assert run(session, state, [], 200).findings == ()
