"""Thousands of drags: the goal keeps its branch, never leaps, and only approaches the target."""

from __future__ import annotations

import dataclasses
import math
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control.arm import NO_GRIPPER, ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.tool_targets import current_target
from katana450.arm.control.state.messages import PRIORITIES
from katana450.arm.control.state.state import Reason, State, Status
from katana450.arm.robot.loader import load
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import POSITION_WORTH_TELLING
from katana450.maths.kinematics.tool import ToolTarget, pitch_and_roll
from tests.kinematics.family import random_member, random_pose

ARMS = Path(__file__).parents[1] / "robot" / "arms"

TICK = 0.01
MOVES_PER_TRIP = 25
"""Number of moves in the same direction, so that the drag covers a distance."""

LONG = "KATANA450_LONG" in os.environ
DRAGS = {Priority.POSE: 10_000 if LONG else 500, Priority.PITCH: 1_000, Priority.POSITION: 1_000}
"""Number of drags for each priority; `make test-long` runs all of POSE."""
DRAGS_OF_OTHER_ARMS = 500 if LONG else 250
"""Number of drags of each other arm, with the priorities in turn."""

GRABS = (1, 5, 25)
"""Number of moves between the start and the end of a drag. In every fourth trip the drag also turns
the rings."""

CAUSES = {Reason.ACROSS_GAP, Reason.AXIS_LIMIT, Reason.AXIS_1, Reason.LINKS}

MAX_TICKS_TO_GOAL = 30
"""Maximum number of ticks until the goal reaches the target; the arm needs many more."""

ROUNDING = 1e-9

TINY = 1e-8
"""[rad/s], [rad/s^2] Tolerance for planning each tick again."""


def tool(chain: Chain, q: FloatArray) -> FloatArray:
    return forward(chain, q)[:3, 3]


def on_branch(chain: Chain, q: FloatArray, branch: Branch, over: float) -> bool:
    """Return whether ``q`` is on ``branch``, on its seam, or beyond it by at most ``over`` [m]."""
    arm = arm_of(chain)
    alpha1, _, alpha3, _, _ = arm.canonical(q)
    x, y = arm.pose(forward(chain, q))[:2, 3]
    r = float(x * math.cos(alpha1) + y * math.sin(alpha1))
    outward = r if branch.shoulder == "front" else -r
    bend = math.sin(alpha3) if branch.elbow == "up" else -math.sin(alpha3)
    return bool(bend >= -ROUNDING and outward >= -over)


def on_elbow(chain: Chain, q: FloatArray, branch: Branch) -> bool:
    """Return whether ``q`` has the elbow of ``branch``, or is stretched."""
    bend = math.sin(arm_of(chain).canonical(q)[2])
    return (bend if branch.elbow == "up" else -bend) >= -ROUNDING


@dataclasses.dataclass(frozen=True)
class Trip:
    """A series of moves in one direction.

    Attributes:
        q: posture at the start [rad].
        way: change of the target per move [m].
        grab: number of moves per drag.
        turns: standard deviation of the turns of the rings [rad]; 0 for no turns.
        priority: the priority of the drags.
    """

    q: FloatArray
    way: FloatArray
    grab: int
    turns: float
    priority: Priority


def trips(chain: Chain, priorities: tuple[Priority, ...], drags: int) -> Iterator[Trip]:
    """Yield trips: a third across axis 1, the others anywhere, most out of the workspace."""
    T_C_S = arm_of(chain).T_C_S
    size = arm_of(chain).reach
    for number in range(drags // MOVES_PER_TRIP):
        rng = np.random.default_rng([450, number])
        q = rng.uniform(chain.lower, chain.upper)
        way = rng.normal(size=3)
        if number % 3 == 0:
            x, y, _ = T_C_S[:3, :3] @ tool(chain, q) + T_C_S[:3, 3]
            across = np.array([-x, -y, 0.05 * rng.normal()]) + rng.normal(scale=0.02, size=3)
            way = T_C_S[:3, :3].T @ across
        # Most trips are slow, some as fast as a person can move.
        length = rng.uniform(0.003, 0.03) * size if number % 20 else (0.1, 0.4)[number // 20 % 2]
        yield Trip(
            q,
            length * way / np.linalg.norm(way),
            GRABS[number % len(GRABS)],
            0.05 if number % 4 == 3 else 0.0,
            priorities[number % len(priorities)],
        )


def drag(chain: Chain, session: Session, trip: Trip, seed: int) -> Iterator[State]:
    """Yield the state after each move, with every tick checked."""
    rng = np.random.default_rng([seed, 1])
    state = session.begin(trip.q, 0.0, 0.0)
    state = session.step(state, [cmd.SetPriority(trip.priority)], state.t + TICK)
    branch = state.branch
    target = tool(chain, trip.q)
    limit, turning = 3.0 * arm_of(chain).reach, trip.turns > 0.0
    for number in range(MOVES_PER_TRIP):
        if turning and number % 3 == 2:
            desired = current_target(session.require_arm(), state)
            turn = rng.normal(scale=trip.turns, size=2)
            command: cmd.Command = cmd.Turn(desired.pitch + turn[0], desired.roll + turn[1])
        else:
            target = np.clip(target + trip.way, -limit, limit)
            command = cmd.Position(target)
        before = state
        state = check_tick(chain, session, state, command)
        ticks = 1
        while state.since is not None:
            assert ticks < MAX_TICKS_TO_GOAL
            state = check_tick(chain, session, state)
            ticks += 1
        assert isinstance(state.target, ToolTarget)
        check_goal(chain, before, state, state.target)
        check_findings(chain, state, state.target)
        state = check_tick(chain, session, state)
        assert state.branch == branch
        yield state
        if number % trip.grab == trip.grab - 1:
            state = session.step(state, [cmd.EndDrag()], state.t)
            target = tool(chain, state.goal)


def misses(chain: Chain, q: FloatArray, target: ToolTarget, priority: Priority) -> list[float]:
    """Return the distances of ``q`` from the target, in the order of the priority."""
    pitch, _ = pitch_and_roll(chain, q)
    position = math.dist(tool(chain, q), target.position)
    if priority is Priority.PITCH:
        return [abs(math.remainder(pitch - target.pitch, math.tau)), position]
    return [position]


def check_goal(chain: Chain, before: State, state: State, target: ToolTarget) -> None:
    """Check that a move never leads the goal away from its target, however many hops it takes."""
    was, now = (misses(chain, s.goal, target, state.priority) for s in (before, state))
    for a, b in zip(was, now, strict=True):
        assert b <= a + ROUNDING
        if b < a - ROUNDING:
            break
    assert chain.within_limits(state.goal, slack=0.0)


def check_findings(chain: Chain, state: State, target: ToolTarget) -> None:
    """Check that every loss is reported, with a cause that a person can act on."""
    reasons = {finding.reason for finding in state.findings}
    lost = math.dist(tool(chain, state.goal), target.position) > POSITION_WORTH_TELLING
    assert reasons or not lost
    assert not reasons or reasons & CAUSES


def check_tick(
    chain: Chain,
    session: Session,
    before: State,
    *commands: cmd.Command,
) -> State:
    """Execute a tick; check speeds, limits and elbow of the arm, and the branch of the goal.

    The arm follows its goal with limited acceleration, so it turns no corner at once.
    """
    state = session.step(before, commands, before.t + TICK)
    limits = session.require_arm().limits
    dt = TICK * (1 + ROUNDING)
    assert (np.abs(state.setpoint - before.setpoint) <= limits.speed * dt).all()
    assert (np.abs(state.motion.qd - before.motion.qd) <= limits.acceleration * dt + TINY).all()
    assert (np.abs(state.motion.qdd - before.motion.qdd) <= limits.jerk * dt + TINY).all()
    assert chain.within_limits(state.setpoint, slack=0.0)
    if state.goal is not before.goal:
        assert on_branch(chain, state.goal, state.branch, ROUNDING)  # type: ignore[arg-type]
    assert on_elbow(chain, state.setpoint, state.branch)  # type: ignore[arg-type]
    return state


@pytest.mark.cases(1)
@pytest.mark.parametrize("priority", PRIORITIES)
def test_drags_keep_branch_limits_and_progress(
    arm: ArmModel, session: Session, priority: Priority
) -> None:
    counts: Counter[Status] = Counter()
    for number, trip in enumerate(trips(arm.chain, (priority,), DRAGS[priority])):
        counts.update(state.status for state in drag(arm.chain, session, trip, number))
    assert sum(counts.values()) == DRAGS[priority]
    # The drags have reached every status.
    assert all(
        counts[status] > DRAGS[priority] // 20 for status in (Status.OK, Status.LIMITED, Status.GAP)
    ), counts


def other_arms() -> Iterator[tuple[str, Chain]]:
    """Yield arms with offsets of every kind, and tool points beside their roll axis."""
    for name in ("pincherx_150", "youbot_arm"):
        yield name, load(ARMS / f"{name}.urdf").require_arm().chain
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        chain, _ = random_member(rng, lateral=seed != 1)
        middle, half = rng.uniform(-0.5, 0.5, 5), rng.uniform(1.0, 2.6, 5)
        limited = dataclasses.replace(chain, lower=middle - half, upper=middle + half)
        yield f"member {seed}", limited
        yield f"member {seed} beside", limited.with_tool(chain.M @ random_pose(rng, 0.02))


@pytest.mark.cases(2)
@pytest.mark.parametrize("chain", [pytest.param(chain, id=name) for name, chain in other_arms()])
def test_drags_of_other_arms_keep_branch_limits_and_progress(chain: Chain) -> None:
    arm = ArmModel(chain, {"tool": chain.M}, "tool", NO_GRIPPER)
    session = Session(arm, 0.5 * (chain.lower + chain.upper))
    counts: Counter[Status] = Counter()
    for number, trip in enumerate(trips(chain, tuple(PRIORITIES), DRAGS_OF_OTHER_ARMS)):
        counts.update(state.status for state in drag(chain, session, trip, number))
    assert sum(counts.values()) == DRAGS_OF_OTHER_ARMS
    assert set(counts) == {Status.OK, Status.LIMITED, Status.GAP}
