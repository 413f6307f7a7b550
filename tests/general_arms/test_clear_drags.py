"""Drags and jogs of other arms: they arrive, settle, and keep their direction."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.maths.geometry import so3
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.motion.limiter import JointMotion
from tests.general_arms.driven import begun, pose, run, session_of, settled
from tests.general_arms.published_arms import FOUR, KR_6, PANDA, SEVEN, UR5E
from tests.general_arms.test_random_drags import is_clear

MAX_TICKS = 20
"""[1] Those below take 3 to 11."""


class Drag(NamedTuple):
    """A drag that was once held: arm, posture [rad], and motion of the tool [m], [rad]."""

    arm: str
    start: tuple[float, ...]
    move: tuple[float, float, float]
    turn: tuple[float, float, float]


DRAGS = {
    "limit that cuts a joint's step short": Drag(
        "iiwa",
        (-2.434186, -1.719151, -0.832864, 1.701507, 0.883969, 0.90653, -1.607751),
        (-0.0009, 0.0115, -0.0258),
        (-0.4385, -0.1425, 0.5062),
    ),
    "wrist nearly in line": Drag(
        "iiwa",
        (-2.898818, -1.715465, -2.172348, -1.677857, -0.603546, -0.445373, 0.019228),
        (0.036, 0.0021, -0.0185),
        (-0.6332, -0.0998, -0.0064),
    ),
    "axis 5 nearly at its limit": Drag(
        "iiwa",
        (1.732008, -0.594512, -2.741793, 1.853126, -2.900384, -1.194974, 0.752582),
        (-0.1168, -0.0252, 0.0387),
        (-0.6605, -0.4184, -0.2653),
    ),
    "axis 7 nearly at its limit": Drag(
        "Panda",
        (-1.690474, 1.749666, 1.860011, -2.088841, -1.091476, 2.195511, -2.889606),
        (0.0454, 0.0858, 0.0019),
        (-0.1965, -0.0346, -0.6001),
    ),
}


@pytest.mark.parametrize("name", DRAGS)
def test_drag_with_a_clear_way_arrives(name: str) -> None:
    drag = DRAGS[name]
    chain = SEVEN[drag.arm]
    tool, q = DrivenTool(chain), np.array(drag.start)
    state, since = (
        State(0.0, q, 0.0, JointMotion.rest(q), 0.0, q, 0.0, "tcp", tool.branch_of(q)),
        tool.target_at(q),
    )
    target = ToolTarget(
        since.position + np.array(drag.move), rotation=so3.exp(np.array(drag.turn)) @ since.R
    )
    assert is_clear(tool, q, str(state.branch), (since, target))
    for _ in range(MAX_TICKS):
        tracked = tool.track(state, target, since)
        assert tool.branch_of(tracked.best.q) == state.branch
        assert chain.within_limits(tracked.best.q, slack=0.0)
        state = replace(state, goal=tracked.best.q)
        if tracked.since is None:
            break
        assert tracked.since is not None
        since = tracked.since
    assert tracked.since is None
    assert tracked.beyond_gap is None
    assert max(tracked.best.position_error, tracked.best.rotation_error) < 1e-9


SETTLING_TICKS = 8
"""[1] The drags below take 2 or 3 ticks. While free joints moved to the middle of their limits by
themselves, they took 12 to 110."""


@pytest.mark.parametrize("name", SEVEN)
@pytest.mark.parametrize("seed", range(3))
def test_goal_of_a_drag_settles_when_the_pose_is_reached(name: str, seed: int) -> None:
    chain = SEVEN[name]
    session, rng = session_of(chain), np.random.default_rng(seed)
    turned = chain.clamp(session.ready + 0.2 * rng.normal(size=7))
    state = settled(session, begun(session), [cmd.Joints(turned)])
    T, by = pose(session, state), rng.normal(size=3)
    goal = T[:3, 3] + 0.1 * by / np.linalg.norm(by)
    state, ticks = run(session, state, [cmd.Position(goal)]), 1
    while state.since is not None:
        state, ticks = run(session, state), ticks + 1
        assert ticks <= SETTLING_TICKS
    end = settled(session, state)
    assert not end.findings
    np.testing.assert_allclose(pose(session, end)[:3, 3], goal, atol=1e-7)
    assert so3.angle(pose(session, end)[:3, :3], T[:3, :3]) < 1e-7


SPEED, TICKS = 0.05, 80
ARMS = {**FOUR, "UR5e": UR5E, "Panda": PANDA}


@pytest.mark.cases(4)
@pytest.mark.parametrize("direction", [(0.0, 1.0, 0.0), (0.0, 0.0, -1.0)], ids=["y", "down"])
@pytest.mark.parametrize("chain", [pytest.param(c, id=name) for name, c in ARMS.items()])
def test_tool_stays_on_its_line_and_keeps_its_orientation(
    chain: Chain, direction: tuple[float, float, float]
) -> None:
    session = session_of(chain)
    state = begun(session)
    start, line = pose(session, state), np.array(direction)
    rates = np.append(SPEED * line, np.zeros(3))
    deviation = turn = 0.0
    jogs = 0
    while state.moving or not jogs:
        commands = [cmd.Jog(rates)] if jogs < TICKS else []
        state = run(session, state, commands)
        jogs += 1
        T = pose(session, state)
        moved = T[:3, 3] - start[:3, 3]
        deviation = max(deviation, float(np.linalg.norm(moved - (moved @ line) * line)))
        turn = max(turn, so3.angle(T[:3, :3], start[:3, :3]))
    assert moved @ line > 0.5 * SPEED * TICKS * 0.01
    assert deviation < 1e-4
    if chain.n >= 6:
        assert turn < np.radians(0.05)


@pytest.mark.parametrize(
    ("chain", "q", "rates"),
    [
        pytest.param(
            PANDA,
            (0.0, -0.785, 0.785, -2.356, 0.0, 1.8675, 0.0),
            (0.3, 0.0, -0.4, 1.1, 2.2, -1.6),
            id="Panda",
        ),
        pytest.param(
            KR_6,
            (0.0, -1.265, 1.885, -0.785, 0.785, 0.0),
            (0.0, 0.0, -0.5, 0.0, 0.0, 0.0),
            id="KR 6",
        ),
    ],
)
def test_no_joint_is_too_fast_where_the_twist_needs_more_and_more_speed(
    chain: Chain, q: tuple[float, ...], rates: tuple[float, ...]
) -> None:
    session = session_of(chain)
    state, fastest = session.begin(np.array(q), 0.0, 0.0), 0.0
    for _ in range(120):
        state = run(session, state, [cmd.Jog(np.array(rates))])
        fastest = max(fastest, float(np.max(np.abs(state.motion.qd) / chain.speed)))
    assert 0.99 < fastest <= 1.0 + 1e-9
