"""Random drags of published arms keep their branch and their limits, and never leap."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from katana450.arm.control.state.state import State
from katana450.extensions.general_arms.descent import NEAR
from katana450.extensions.general_arms.driven_tool import SETTLINGS, DrivenTool
from katana450.extensions.general_arms.seven_axes import SevenAxes
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import jacobian_space
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.turns import near_turns
from katana450.maths.motion.limiter import JointMotion
from tests.conftest import LONG, MANY_DRAGS
from tests.general_arms.published_arms import (
    FOUR,
    NEAR_MISS,
    OFFSET,
    SEVEN,
    SIX,
    SKEWED,
    XARM_7,
)

ARMS = {**FOUR, **SIX, **SEVEN, **SKEWED, **OFFSET, **NEAR_MISS, "xArm 7": XARM_7}
DRAGS_OF_A_TRIP = 10
MAX_CALLS = 400
"""Number of ticks of a drag after which it must have ended if its way is clear."""

HELD_CALLS = 60
"""Number of ticks after which a drag whose way is not clear is given up."""

MAX_MOVE = 2.0
"""[rad] A call moves the goal by a few hops of 0.1 rad at most."""


PLACES = 64
"""Number of places at which the way of a drag is looked at."""

CLEAR_STEP = 0.05
"""[rad] Turn of a joint from place to place up to which the way is clear."""


def side(chain: Chain, q: FloatArray) -> float:
    """Return the sign of the determinant, which no motion changes without a singularity."""
    return float(np.sign(np.linalg.det(jacobian_space(chain, q))))


class Dragged(NamedTuple):
    """The results of some drags.

    Those with a ``clear`` way have arrived, but for a few ``beside`` of seven axes. They turned
    their arm angle until the edge of the branch was in the way, and reported a missing leap.
    """

    arrived: int
    held: int
    clear: int
    beside: int
    calls: int
    seconds: float


def on_branch(tool: DrivenTool, place: ToolTarget, branch: str, q: FloatArray) -> FloatArray | None:
    """Return the posture of ``branch`` at ``place`` next to ``q``; None if there is none.

    Four axes turn the pose with axis 1, and seven keep their arm angle.
    """
    solver, chain = tool.solver, tool.chain
    if isinstance(solver, SevenAxes):
        posture = solver.at_arm_angle_of(place.T[None], q)[0, solver.branches.index(branch)]
        return near_turns(chain, posture, q) if np.isfinite(posture).all() else None
    for _ in range(SETTLINGS if chain.n < 6 else 1):
        pose = np.array(place.T)
        pose[:3, :3] = tool.pan(q) @ pose[:3, :3]
        posture = solver.on_branch(pose, branch, q)
        if posture is None:
            return None
        q = posture
    return q


def is_clear(
    tool: DrivenTool, q: FloatArray, branch: str, way: tuple[ToolTarget, ToolTarget]
) -> bool:
    """Return whether ``branch`` has postures inside the limits all the way, without a leap.

    Only arms with a closed form can tell. The arm stands at the beginning of the way. Four and
    seven axes, and those with an offset wrist, are led by steps, which end at the edge of a branch:
    their way keeps away from it.
    """
    start, target = way
    descent = tool._tracker.descent
    for k in range(PLACES + 1):
        place = start.towards(target, k / PLACES)
        posture = on_branch(tool, place, branch, q)
        if posture is None or not tool.chain.within_limits(posture):
            return False
        if np.abs(posture - q).max() > CLEAR_STEP or tool.branch_of(posture) != branch:
            return False
        if max(tool.target_at(posture).apart(place)) > 1e-9:
            return False
        if not tool.solver.is_exact:
            look = descent.look(descent.goal(place), tuple(posture.tolist()))
            if look.least < NEAR:
                return False
        q = posture
    return True


def drags(chain: Chain, count: int, priority: Priority = Priority.POSE) -> Dragged:
    """Drag the tool along ``count`` random paths and check every call."""
    tool = DrivenTool(chain)
    rng = np.random.default_rng(23)
    arrived = held = clear = aside = calls = 0
    seconds = 0.0
    ready = tool.ready((), np.eye(4))
    exact = True
    for number in range(count):
        if number % DRAGS_OF_A_TRIP == 0:
            even = number // DRAGS_OF_A_TRIP % 2 == 0
            q = ready if even else rng.uniform(chain.lower, chain.upper)
            state = State(0.0, q, 0.0, JointMotion.rest(q), 0.0, q, 0.0, "tcp", tool.branch_of(q))
            state = replace(state, priority=priority)
            since, exact = tool.target_at(q), True
        # Four axes can only pitch their tool.
        turn = so3.exp(
            0.3 * rng.normal() * chain.S[:3, 3] if chain.n == 4 else 0.3 * rng.normal(size=3)
        )
        target = ToolTarget(since.position + 0.08 * rng.normal(size=3), rotation=turn @ since.R)
        way_is_clear = (
            exact
            and priority is Priority.POSE
            and is_clear(tool, state.goal, str(state.branch), (since, target))
        )
        for _ in range(MAX_CALLS if way_is_clear else HELD_CALLS):
            begin = time.thread_time()
            tracked = tool.track(state, target, since)
            seconds += time.thread_time() - begin
            calls += 1
            goal = tracked.best.q
            assert ((goal >= chain.lower) & (goal <= chain.upper)).all()
            assert np.abs(goal - state.goal).max() <= MAX_MOVE
            assert tool.branch_of(goal) == tracked.best.branch
            if tool.solver.are_separate:
                assert tracked.best.branch == state.branch
            elif chain.n == 6:
                assert side(chain, goal) == side(chain, state.goal)
            state = replace(state, goal=goal, branch=tracked.best.branch)
            if tracked.since is None:
                break
            assert tracked.since is not None
            since = tracked.since
        since = target
        exact = tracked.best.position_error < 1e-6 and tracked.best.rotation_error < 1e-6
        if way_is_clear and not exact:
            assert chain.n == 7, f"drag {number} has a clear way and does not arrive"
            assert tracked.beyond_gap is not None
            aside += 1
        clear += way_is_clear
        arrived += exact
        held += not exact
    return Dragged(arrived, held, clear, aside, calls, seconds)


@pytest.mark.cases(3)
@pytest.mark.parametrize("name", ["UR5e", "xArm 6", "KR 6", "OpenMANIPULATOR-X", "skewed 6"])
def test_drags_keep_branch_and_limits(name: str) -> None:
    # Of four axes few drags have a clear way.
    count = 20 if LONG else 12 if ARMS[name].n == 4 else 8
    dragged = drags(ARMS[name], count)
    assert dragged.arrived + dragged.held == count
    assert dragged.arrived >= 3
    if name != "skewed 6":
        assert dragged.clear >= 2


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", SEVEN)
def test_drags_of_seven_axes_keep_branch_and_limits(name: str) -> None:
    count = 26 if LONG else 12
    dragged = drags(ARMS[name], count)
    assert dragged.clear >= 2
    assert dragged.beside == 0
    # Free joints do not go on to the middle of their limits while the tool waits beside its place.
    assert dragged.calls <= 20 * count


@pytest.mark.long
@pytest.mark.parametrize("name", ARMS)
def test_many_drags_keep_branch_and_limits(name: str) -> None:
    dragged = drags(ARMS[name], MANY_DRAGS)
    assert dragged.beside <= dragged.clear / 1000
    print(
        f"{name}: {dragged.arrived} arrived, {dragged.clear} had a clear way, "
        f"{dragged.beside} of these were held, {dragged.held} held, {dragged.calls} calls, "
        f"{1e3 * dragged.seconds / dragged.calls:.2f} ms each"
    )


@pytest.mark.parametrize("priority", [Priority.POSITION, Priority.ORIENTATION])
def test_drags_keep_branch_and_limits_under_every_priority(priority: Priority) -> None:
    drags(ARMS["UR5e"], 6, priority)
