"""The goal of a drag with seven axes settles as soon as the pose is reached."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from tests.general_arms.driven import begun, pose, run, session_of, settled
from tests.general_arms.published_arms import SEVEN

MAX_TICKS = 8
"""[1] The drags below take 2 or 3 ticks. While free joints moved to the middle of their limits by
themselves, they took 12 to 110."""


def ticks_of(name: str, seed: int) -> tuple[int, State, FloatArray, float]:
    """Return the ticks of a drag by 0.1 m until its goal settles, and the end of it."""
    chain = SEVEN[name]
    session, rng = session_of(chain), np.random.default_rng(seed)
    turned = chain.clamp(session.ready + 0.2 * rng.normal(size=7))
    state = settled(session, begun(session), [cmd.Joints(turned)])
    T, by = pose(session, state), rng.normal(size=3)
    goal = T[:3, 3] + 0.1 * by / np.linalg.norm(by)
    state, ticks = run(session, state, [cmd.Position(goal)]), 1
    while state.since is not None:
        state, ticks = run(session, state), ticks + 1
        assert ticks < 1000
    end = settled(session, state)
    turn = so3.angle(pose(session, end)[:3, :3], T[:3, :3])
    return ticks, end, pose(session, end)[:3, 3] - goal, turn


@pytest.mark.parametrize("name", SEVEN)
@pytest.mark.parametrize("seed", range(3))
def test_goal_of_a_drag_settles_when_the_pose_is_reached(name: str, seed: int) -> None:
    ticks, end, off, turn = ticks_of(name, seed)
    assert ticks <= MAX_TICKS
    assert not end.findings
    np.testing.assert_allclose(off, 0.0, atol=1e-7)
    assert turn < 1e-7
