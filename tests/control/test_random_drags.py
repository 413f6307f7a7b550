"""Random drags to any point: where the arm follows, and where it holds.

Each drag is one motion of the hand from the tool of a random posture to the tool point of another.
The arm comes to rest, and the hand lets go.
"""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import TOOL_SPEED, Session
from katana450.arm.control.state.state import State, Status
from katana450.arm.robot.loader import load
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import pitch_and_roll
from katana450.maths.kinematics.velocity import tool_speed
from katana450.resources import INCLUDED
from tests.conftest import LONG, MANY_DRAGS

TICK = 0.01

DRAGS = MANY_DRAGS if LONG else 5
"""Number of drags of each arm."""

HARD_DRAGS = (1703, 4081, 6261, 6817)
"""Numbers of drags that failed once, of 10,000, as where strides of 20 mm lost the pitch."""

MAX_TICKS = 6000

ROUNDING = 1e-9

REPLANNED = 1e-5
"""[1] Tolerance of the jerk, which is planned again in each tick."""

ON_TARGET = 1e-6
"""[m] Distance from the target at which a drag has arrived."""

STRIDE = 0.002
"""[m] Step of the search that follows the hand."""


@pytest.fixture(
    params=[
        pytest.param("katana450", marks=pytest.mark.long),
        pytest.param("so101", marks=pytest.mark.long),
        "pincherx_150",
    ]
)
def dragged(request: pytest.FixtureRequest) -> Session:
    """A session of each arm, without collision checks."""
    pincherx_150 = Path(__file__).parents[1] / "robot" / "arms" / "pincherx_150.urdf"
    arm = load(INCLUDED.get(request.param, pincherx_150)).require_arm()
    return Session(arm, arm.chain.clamp(np.zeros(5)))


def five(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the tool point [m], pitch and roll [rad] at `q` (5,) [rad]."""
    return np.append(forward(chain, q)[:3, 3], pitch_and_roll(chain, q))


def followed_by_newton(chain: Chain, q: FloatArray, target: FloatArray) -> FloatArray | None:
    """Return the posture at `target` (3,) [m] if the hand's way there is clear, else None.

    Pitch and roll stay. Newton's method follows the way in small steps inside the limits.
    """
    start = five(chain, q)
    way = target - start[:3]
    count = max(math.ceil(float(np.linalg.norm(way)) / STRIDE), 1)
    for number in range(1, count + 1):
        desired = start + np.append(number / count * way, (0.0, 0.0))
        first = q
        for _ in range(6):
            point = five(chain, q)
            error = desired - point
            error[3:] = np.remainder(error[3:] + math.pi, math.tau) - math.pi
            J = np.empty((5, 5))
            for axis in range(5):
                step = np.zeros(5)
                step[axis] = 1e-6
                change = five(chain, q + step) - point
                change[3:] = np.remainder(change[3:] + math.pi, math.tau) - math.pi
                J[:, axis] = change / 1e-6
            if abs(np.linalg.det(J)) < 1e-9:
                return None
            q = q + np.linalg.solve(J, error)
            if np.abs(error).max() < 1e-8:
                break
        else:
            return None
        # Beside a singularity the joints would be too fast for the steps of this search.
        if np.abs(q - first).max() > 0.05 or not chain.within_limits(q, slack=0.0):
            return None
    return q


def settled(session: Session, state: State) -> State:
    """Return ``state`` after the arm has come to rest; every tick keeps limits and tool speed."""
    arm = session.require_arm()
    chain, limits = arm.chain, arm.limits
    for _ in range(MAX_TICKS):
        if not state.moving and state.since is None:
            return state
        before, state = state, session.step(state, (), state.t + TICK)
        motion = state.motion
        assert chain.within_limits(motion.q, slack=0.0)
        assert (np.abs(motion.qd) <= limits.speed * (1.0 + ROUNDING)).all()
        assert (np.abs(motion.qdd) <= limits.acceleration * (1.0 + ROUNDING)).all()
        jerk = np.abs(motion.qdd - before.motion.qdd) / TICK
        assert (jerk <= limits.jerk * (1.0 + REPLANNED)).all(), (jerk / limits.jerk).max() - 1.0
        assert tool_speed(chain, motion.q, motion.qd) <= TOOL_SPEED * (1.0 + ROUNDING)
        assert state.branch == before.branch
    raise AssertionError("The arm does not come to rest.")


def test_random_drags_arrive_where_the_way_is_clear(dragged: Session) -> None:
    counts = Counter[str]()
    for number in (*range(DRAGS), *HARD_DRAGS):
        check_drag(dragged, number, counts)
    print(dict(counts))
    assert counts["clear way"] > 0


def check_drag(session: Session, number: int, counts: Counter[str]) -> None:
    """Drag from a random posture to the tool point of another."""
    arm = session.require_arm()
    chain, rng = arm.chain, np.random.default_rng([17, number])
    start, end = rng.uniform(chain.lower, chain.upper, (2, 5))
    target = forward(chain, end)[:3, 3]
    state = session.begin(start, 0.0, 0.0)
    branch = state.branch
    state = settled(session, session.step(state, [cmd.Position(target)], state.t + TICK))
    away = float(np.linalg.norm(forward(chain, state.setpoint)[:3, 3] - target))
    counts["arrived" if away <= ON_TARGET else "held"] += 1
    if followed_by_newton(chain, start, target) is not None:
        counts["clear way"] += 1
        assert away <= ON_TARGET, number
        assert state.status is Status.OK, number
    state = session.step(state, [cmd.EndDrag()], state.t + TICK)
    assert state.branch == branch
