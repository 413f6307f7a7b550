"""Steps of the tool: their length and direction, in a row and beyond the reach."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import JogFrame
from tests.ticks import rested, ticked

EXACT = 1e-6
"""[m] Tolerance of the tracker."""


def pose(session: Session, state: State) -> FloatArray:
    """Return the pose (4, 4) of the tool at the setpoint."""
    return forward(session.require_arm().chain_to(state.tool), state.setpoint)


def step(
    x: float = 0.0, y: float = 0.0, z: float = 0.0, frame: JogFrame = JogFrame.BASE
) -> cmd.StepTool:
    return cmd.StepTool(np.array([x, y, z, 0.0, 0.0]), frame)


@pytest.mark.parametrize("length", [1e-4, 1e-3, 1e-2])
def test_step_moves_the_tool_by_its_length(session: Session, state: State, length: float) -> None:
    before = pose(session, state)
    after = pose(session, rested(session, state, step(z=-length)))
    np.testing.assert_allclose(after[:3, 3] - before[:3, 3], (0.0, 0.0, -length), atol=EXACT)
    np.testing.assert_allclose(after[:3, :3], before[:3, :3], atol=1e-5)


def test_steps_given_at_once_add_up(session: Session, state: State) -> None:
    before = pose(session, state)
    steps: list[cmd.Command] = [step(x=-0.001), step(x=-0.001), step(z=0.001)]
    state = ticked(session, state, *steps)
    state = rested(session, ticked(session, state, ticks=2), step(x=-0.001))
    moved = pose(session, state)[:3, 3] - before[:3, 3]
    np.testing.assert_allclose(moved, (-0.003, 0.0, 0.001), atol=EXACT)


def test_step_along_the_tool_follows_its_direction(session: Session, state: State) -> None:
    before = pose(session, state)
    state = rested(session, state, step(x=-0.01, frame=JogFrame.TOOL))
    moved = pose(session, state)[:3, 3] - before[:3, 3]
    np.testing.assert_allclose(moved, before[:3, :3] @ (-0.01, 0.0, 0.0), atol=EXACT)


def test_step_turns_pitch_and_roll(session: Session, state: State) -> None:
    before = state.setpoint
    turned = cmd.StepTool(np.array([0.0, 0.0, 0.0, 0.0, 0.02]))
    state = rested(session, state, turned)
    np.testing.assert_allclose(state.setpoint[4] - before[4], 0.02, atol=EXACT)
    turned = cmd.StepTool(np.array([0.0, 0.0, 0.0, 0.02, 0.0]))
    state = rested(session, state, turned)
    np.testing.assert_allclose(sum(state.setpoint[1:4] - before[1:4]), 0.02, atol=EXACT)


def test_steps_beyond_the_reach_do_not_pile_up(session: Session, state: State) -> None:
    for _ in range(20):
        state = rested(session, state, step(x=0.1))
    farthest = pose(session, state)[:3, 3]
    state = rested(session, state, step(x=-0.02))
    assert pose(session, state)[0, 3] < farthest[0] - 0.01
