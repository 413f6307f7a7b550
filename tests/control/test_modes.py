"""Jog, stream, drag and steps of the tool replace each other; nothing of the earlier remains."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import Jogging, Servoing, Tracking
from katana450.arm.control.state.state import State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import JogFrame
from tests.ticks import TICK, ticked

JOG = cmd.Jog(np.array([0.0, 0.08, 0.0, 0.0, 0.0]))

FAR_DRAG = cmd.Position(np.array([-0.2, 0.35, 0.1]))
"""A target farther than one tick can track."""


def streamed(session: Session, state: State, ticks: int) -> State:
    """Return the state after a stream that turns axis 1."""
    q = np.array(state.goal)
    for _ in range(ticks):
        q[0] += 0.2 * TICK
        state = ticked(session, state, cmd.Servo(q.copy()))
    return state


def point(session: Session, q: FloatArray) -> FloatArray:
    return forward(session.require_arm().chain, q)[:3, 3]


def test_drag_replaces_a_jog_completely(session: Session, state: State) -> None:
    state = ticked(session, state, JOG, ticks=30, every=True)
    dragged = ticked(session, state, FAR_DRAG)
    assert dragged.jogging is None
    dragged = ticked(session, dragged, ticks=300)
    desired = FAR_DRAG.p
    np.testing.assert_allclose(point(session, dragged.setpoint), desired, rtol=0, atol=1e-9)
    # The next drag moves the goal along its own line.
    settled = ticked(session, dragged, cmd.EndDrag())
    start, way = point(session, settled.goal), np.array((0.02, 0.12, -0.03))
    for fraction in np.linspace(0.05, 1.0, 20):
        settled = ticked(session, settled, cmd.Position(start + fraction * way))
        off = point(session, settled.goal) - start
        assert np.linalg.norm(np.cross(off, way)) / np.linalg.norm(way) < 1e-6


BEGINNINGS: dict[type, Callable[[Session, State], State]] = {
    Jogging: lambda session, state: ticked(session, state, JOG),
    Servoing: lambda session, state: streamed(session, state, 1),
    Tracking: lambda session, state: ticked(session, state, FAR_DRAG),
}


@pytest.mark.parametrize(("first", "second"), list(itertools.permutations(BEGINNINGS, 2)))
def test_later_mode_replaces_the_earlier_one(
    session: Session, state: State, first: type, second: type
) -> None:
    beginning = BEGINNINGS[first](session, state)
    assert isinstance(beginning.mode, first)
    assert isinstance(BEGINNINGS[second](session, beginning).mode, second)


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
        rested = ticked(session, ticked(session, braking, cmd.Pause()), ticks=150)
        assert rested.motion.at_rest
        resumed = ticked(session, ticked(session, rested, cmd.Resume()), ticks=5)
        assert resumed.setpoint.tobytes() == rested.setpoint.tobytes()


EXACT = 1e-6
"""[m] Tolerance of the tracker."""


def pose(session: Session, state: State) -> FloatArray:
    """Return the pose (4, 4) of the tool at the setpoint."""
    return forward(session.require_arm().chain_to(state.tool), state.setpoint)


def at_rest(session: Session, state: State) -> State:
    for _ in range(40):
        state = ticked(session, state, ticks=25)
        if not state.moving:
            return state
    raise AssertionError("the arm does not come to rest")


def step(
    x: float = 0.0, y: float = 0.0, z: float = 0.0, frame: JogFrame = JogFrame.BASE
) -> cmd.StepTool:
    return cmd.StepTool(np.array([x, y, z, 0.0, 0.0]), frame)


@pytest.mark.parametrize("length", [1e-4, 1e-3, 1e-2])
def test_step_moves_the_tool_by_its_length(session: Session, state: State, length: float) -> None:
    before = pose(session, state)
    after = pose(session, at_rest(session, ticked(session, state, step(z=-length))))
    np.testing.assert_allclose(after[:3, 3] - before[:3, 3], (0.0, 0.0, -length), atol=EXACT)
    np.testing.assert_allclose(after[:3, :3], before[:3, :3], atol=1e-5)


def test_steps_given_at_once_add_up(session: Session, state: State) -> None:
    before = pose(session, state)
    steps: list[cmd.Command] = [step(x=-0.001), step(x=-0.001), step(z=0.001)]
    state = ticked(session, state, *steps)
    state = at_rest(session, ticked(session, ticked(session, state, ticks=2), step(x=-0.001)))
    moved = pose(session, state)[:3, 3] - before[:3, 3]
    np.testing.assert_allclose(moved, (-0.003, 0.0, 0.001), atol=EXACT)


def test_step_along_the_tool_follows_its_direction(session: Session, state: State) -> None:
    before = pose(session, state)
    state = at_rest(session, ticked(session, state, step(x=-0.01, frame=JogFrame.TOOL)))
    moved = pose(session, state)[:3, 3] - before[:3, 3]
    np.testing.assert_allclose(moved, before[:3, :3] @ (-0.01, 0.0, 0.0), atol=EXACT)


def test_step_turns_pitch_and_roll(session: Session, state: State) -> None:
    before = state.setpoint
    turned = cmd.StepTool(np.array([0.0, 0.0, 0.0, 0.0, 0.02]))
    state = at_rest(session, ticked(session, state, turned))
    np.testing.assert_allclose(state.setpoint[4] - before[4], 0.02, atol=EXACT)
    turned = cmd.StepTool(np.array([0.0, 0.0, 0.0, 0.02, 0.0]))
    state = at_rest(session, ticked(session, state, turned))
    np.testing.assert_allclose(sum(state.setpoint[1:4] - before[1:4]), 0.02, atol=EXACT)


def test_steps_beyond_the_reach_do_not_pile_up(session: Session, state: State) -> None:
    for _ in range(20):
        state = at_rest(session, ticked(session, state, step(x=0.1)))
    farthest = pose(session, state)[:3, 3]
    state = at_rest(session, ticked(session, state, step(x=-0.02)))
    assert pose(session, state)[0, 3] < farthest[0] - 0.01
