"""A jog of any arm keeps the direction of its twist while it starts, moves and brakes."""

from __future__ import annotations

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.maths.geometry import so3
from katana450.maths.kinematics.chain import Chain
from tests.general_arms.driven import begun, pose, run, session_of
from tests.general_arms.published_arms import FOUR, KR_6, PANDA, UR5E

SPEED, TICKS = 0.05, 80
ARMS = {**FOUR, "UR5e": UR5E, "Panda": PANDA}


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
