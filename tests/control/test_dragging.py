"""Thousands of drags: the goal never leaves the branch, never leaps, never turns away."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator

import numpy as np

from app.control import commands as cmd
from app.control.arm import Arm
from app.control.choices import wish
from app.control.session import Session
from app.control.state import State, Status
from app.geometry.arrays import FloatArray
from app.kinematics.branch import Branch
from app.kinematics.forward import forward

TICK = 0.01
DRAGS = 10_000
A_TRIP = 25
"""Moves of the hand one after the other that go the same way, so that they get somewhere."""

GRABS = (1, 5, 25)
"""Moves of the hand between taking hold and letting go; in every fourth trip it turns the rings
too."""

ROUNDING = 1e-9

NEAR_AXIS_1 = 0.05
"""[m] The joints go straight to the goal, so the tool goes there in a bow. Only this near axis 1,
where axis 1 has to turn far, and where the rings turn the tool on the spot, can the bow lead away
from a target for a moment."""

BOW = 1e-3
"""[m] By how much in a tick, at most."""

OVER_AXIS_1 = 0.02
"""[m] By the same bow the tool point may pass axis 1 on the wrong side, where the goal keeps to the
right one."""


def tool(arm: Arm, q: FloatArray) -> FloatArray:
    return forward(arm.chain, q)[:3, 3]


def on_branch(q: FloatArray, point: FloatArray, branch: Branch, over: float) -> bool:
    """Whether ``q`` with its tool ``point`` is on ``branch``, or its seam, or ``over`` it [m]."""
    r = float(point[0] * math.cos(q[0]) + point[1] * math.sin(q[0]))
    outward = r if branch.shoulder == "front" else -r
    bend = q[2] if branch.elbow == "up" else -q[2]
    return bool(bend >= -ROUNDING and outward >= -over)


def seconds_left(arm: Arm, state: State) -> float:
    """How long the slowest joint needs to the goal [s]."""
    return float((np.abs(state.goal - state.setpoint) / arm.chain.speed).max())


def trips(arm: Arm, rng: np.random.Generator) -> Iterator[tuple[FloatArray, FloatArray, int]]:
    """Where each trip starts [rad], what a move of the hand adds [m], and moves between grabs.

    A third goes across axis 1, the others anywhere, most of them out of the workspace.
    """
    for number in range(DRAGS // A_TRIP):
        q = rng.uniform(arm.chain.lower, arm.chain.upper)
        way = rng.normal(size=3)
        if number % 3 == 0:
            x, y, _ = tool(arm, q)
            way = np.array([-x, -y, 0.05 * rng.normal()]) + rng.normal(scale=0.02, size=3)
        # Mostly slow, some as fast as a hand can.
        length = rng.uniform(0.002, 0.02) if number % 20 else 0.06
        yield q, length * way / np.linalg.norm(way), GRABS[number % len(GRABS)]


def test_ten_thousand_drags(arm: Arm, session: Session) -> None:
    rng = np.random.default_rng(450)
    seen: Counter[Status] = Counter()
    for number, (q, way, grab) in enumerate(trips(arm, rng)):
        turns = number % 4 == 3
        state = session.begin(q, 0.0, 0.0)
        branch = state.branch
        target = tool(arm, q)
        for drag in range(A_TRIP):
            if turns and drag % 3 == 2:
                wished = wish(arm, state)
                turn = rng.normal(scale=0.05, size=2)
                command: cmd.Command = cmd.TurnTool(wished.pitch + turn[0], wished.roll + turn[1])
            else:
                target = np.clip(target + way, -1.4, 1.4)
                command = cmd.MoveTool(target)
            moved = session.step(state, [command], state.t + TICK)
            waited = session.step(moved, [], moved.t + TICK)
            check_goal(arm, state, moved, target)
            check_motion(arm, state, moved, target, turns)
            check_motion(arm, moved, waited, target, turns)
            left = max(seconds_left(arm, moved) - TICK, 0.0)
            assert seconds_left(arm, waited) <= left + ROUNDING
            assert waited.branch == branch
            state = waited
            seen[state.status] += 1
            if drag % grab == grab - 1:
                state = session.step(state, [cmd.Settle()], state.t)
                target = tool(arm, state.goal)
    assert sum(seen.values()) == DRAGS
    # It did go through all of it.
    assert all(seen[status] > DRAGS // 20 for status in (Status.OK, Status.LIMITED, Status.HELD))


def check_goal(arm: Arm, before: State, state: State, target: FloatArray) -> None:
    """Whatever the target, no drag moves the goal's tool point away from it."""
    was, now = tool(arm, before.goal), tool(arm, state.goal)
    assert math.dist(now, target) <= math.dist(was, target) + ROUNDING
    assert on_branch(state.goal, now, state.branch, ROUNDING)


def check_motion(arm: Arm, before: State, state: State, target: FloatArray, turns: bool) -> None:
    """The arm keeps to its speeds, limits and branch, and goes to a target it can reach."""
    chain = arm.chain
    assert (np.abs(state.setpoint - before.setpoint) <= chain.speed * TICK * (1 + ROUNDING)).all()
    assert chain.within_limits(state.setpoint, slack=0.0)
    was, now = tool(arm, before.setpoint), tool(arm, state.setpoint)
    assert on_branch(state.setpoint, now, state.branch, OVER_AXIS_1)
    if state.status is Status.OK:
        near = min(math.hypot(now[0], now[1]), math.hypot(target[0], target[1])) < NEAR_AXIS_1
        bow = BOW if near or turns else ROUNDING
        assert math.dist(now, target) <= math.dist(was, target) + bow
