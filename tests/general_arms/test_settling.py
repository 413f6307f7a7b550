"""The goal of a drag with seven axes settles as soon as the pose is reached, or cannot be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from tests.general_arms.driven import begun, pose, run, session_of, settled
from tests.general_arms.published_arms import PANDA, SEVEN

MAX_TICKS = 8
"""[1] The drags below take 2 or 3 ticks. While free joints moved to the middle of their limits by
themselves, they took 12 to 110."""


MAX_TICKS_BEYOND = 45
"""[1] The drags out of reach below take less than this. While the steps did not
regard how the tool's path bends, they took 220 to 378."""

BEYOND = [
    (
        (-0.3309, -0.3093, -0.3851, -0.6089, 0.072, 0.6322, -1.275),
        (0.1279, 0.0508, 0.0442),
        (0.2411, 0.0548, -0.0657),
        0.002,
    ),
    (
        (-0.8732, -0.0809, 1.2791, -1.3168, 0.7935, 0.5879, 1.9381),
        (-0.0748, 0.0008, 0.1322),
        (-0.376, 0.3191, 0.5508),
        0.1,
    ),
    (
        (0.3319, -1.561, -0.4267, -1.0067, 0.5578, 1.405, 1.9104),
        (-0.0934, -0.1064, 0.0699),
        (0.0862, 0.3108, 0.422),
        0.01,
    ),
]
"""Postures of the Panda [rad], with the way of the tool [m], its turn [rad], and the distance that
may be left [m]; 64 to 121 mm were left before."""


def ticks_of(name: str, seed: int) -> tuple[int, State, FloatArray, float]:
    """Return the ticks of a drag by 0.1 m until its goal settles, and the end of it."""
    chain = SEVEN[name]
    session, rng = session_of(chain), np.random.default_rng(seed)
    turned = chain.clamp(session.ready + 0.2 * rng.normal(size=7))
    state = settled(session, begun(session), [cmd.SetJoints(turned)])
    T, by = pose(session, state), rng.normal(size=3)
    goal = T[:3, 3] + 0.1 * by / np.linalg.norm(by)
    state, ticks = run(session, state, [cmd.MoveTool(goal)]), 1
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


@pytest.mark.parametrize(("q", "by", "turn", "left"), BEYOND)
def test_goal_of_a_drag_out_of_reach_settles(
    q: tuple[float, ...], by: tuple[float, ...], turn: tuple[float, ...], left: float
) -> None:
    tool = DrivenTool(PANDA)
    branch = tool.branch_of(np.array(q))
    state = State.standing(np.array(q), 0.0, 0.0, "tcp", branch)
    since = tool.target_at(state.goal)
    target = ToolPose(since.position + by, so3.exp(np.array(turn)) @ since.R)
    ticks, tracked = 1, tool.track(state, target, since)
    while tracked.since is not None:
        state, ticks = replace(state, goal=tracked.best.q), ticks + 1
        assert ticks <= MAX_TICKS_BEYOND
        tracked = tool.track(state, target, tracked.since)
    assert tracked.best.position_error <= left
    assert tool.branch_of(tracked.best.q) == branch
    # The goal stays there.
    again = tool.track(replace(state, goal=tracked.best.q), target, target)
    assert np.abs(again.best.q - tracked.best.q).max() < 0.2
