"""Jog, stream and drag replace each other, and nothing of the earlier mode remains."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.modes import Jogging, Servoing, Tracking
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward

TICK = 0.01

JOG = cmd.Jog(np.array([0.0, 0.08, 0.0, 0.0, 0.0]))

FAR_DRAG = cmd.Position(np.array([-0.2, 0.35, 0.1]))
"""A target farther than one tick can track."""


def run(session: Session, state: State, command: cmd.Command | None, ticks: int = 1) -> State:
    """Run ``ticks`` ticks with ``command`` in each of them."""
    for _ in range(ticks):
        commands = [] if command is None else [command]
        state = session.step(state, commands, state.t + TICK)
        state = session.observe(state, state.setpoint, state.gripper_setpoint)
    return state


def streamed(session: Session, state: State, ticks: int) -> State:
    """Return the state after a stream that turns axis 1."""
    q = np.array(state.goal)
    for _ in range(ticks):
        q[0] += 0.2 * TICK
        state = run(session, state, cmd.Servo(q.copy()))
    return state


def point(session: Session, q: FloatArray) -> FloatArray:
    return forward(session.require_arm().chain, q)[:3, 3]


def test_drag_replaces_a_jog_completely(session: Session, state: State) -> None:
    state = run(session, state, JOG, 30)
    dragged = run(session, state, FAR_DRAG)
    assert dragged.jogging is None
    dragged = run(session, dragged, None, 300)
    desired = FAR_DRAG.p
    np.testing.assert_allclose(point(session, dragged.setpoint), desired, rtol=0, atol=1e-9)
    # The next drag moves the goal along its own line.
    settled = run(session, dragged, cmd.EndDrag())
    start, way = point(session, settled.goal), np.array((0.02, 0.12, -0.03))
    for fraction in np.linspace(0.05, 1.0, 20):
        settled = run(session, settled, cmd.Position(start + fraction * way))
        off = point(session, settled.goal) - start
        assert np.linalg.norm(np.cross(off, way)) / np.linalg.norm(way) < 1e-6


BEGINNINGS: dict[type, Callable[[Session, State], State]] = {
    Jogging: lambda session, state: run(session, state, JOG),
    Servoing: lambda session, state: streamed(session, state, 1),
    Tracking: lambda session, state: run(session, state, FAR_DRAG),
}


@pytest.mark.parametrize(("first", "second"), list(itertools.permutations(BEGINNINGS, 2)))
def test_later_mode_replaces_the_earlier_one(
    session: Session, state: State, first: type, second: type
) -> None:
    begun = BEGINNINGS[first](session, state)
    assert isinstance(begun.mode, first)
    assert isinstance(BEGINNINGS[second](session, begun).mode, second)


def test_resume_moves_nothing_where_a_pause_ended_the_brake_of_a_hold(
    session: Session, state: State
) -> None:
    random = np.random.default_rng(450)
    for _ in range(20):
        away = cmd.Joints(session.ready + random.uniform(-0.5, 0.5, 5))
        braking = run(session, run(session, state, away), None, int(random.integers(5, 40)))
        braking = run(session, run(session, braking, cmd.Hold()), None, int(random.integers(1, 8)))
        rested = run(session, run(session, braking, cmd.Pause()), None, 150)
        assert rested.motion.at_rest
        resumed = run(session, run(session, rested, cmd.Resume()), None, 5)
        assert resumed.setpoint.tobytes() == rested.setpoint.tobytes()
