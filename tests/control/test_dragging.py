"""Thousands of drags: the goal never leaves the branch, never leaps, never turns away."""

from __future__ import annotations

import dataclasses
import math
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from katana450.arm.control import commands as cmd
from katana450.arm.control.arm import NO_GRIPPER, ArmModel
from katana450.arm.control.branch_options import current_target
from katana450.arm.control.session import Session
from katana450.arm.control.state import Reason, State, Status, ToolTarget
from katana450.arm.robot.loader import load
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.freedoms import pitch_and_roll
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.projection import POSITION_WORTH_TELLING
from tests.kinematics.family import random_member, random_pose

ARMS = Path(__file__).parents[1] / "robot" / "arms"

TICK = 0.01
A_TRIP = 25
"""Moves of the hand one after the other that go the same way, so that they get somewhere."""

LONG = "KATANA450_LONG" in os.environ
DRAGS = {Priority.POSE: 10_000 if LONG else 2_500, Priority.PITCH: 1_000, Priority.POSITION: 1_000}
"""All of them with `make test-long`."""
OTHERS = 500
"""Drags of each other arm, the readings by turns."""

GRABS = (1, 5, 25)
"""Moves of the hand between taking hold and letting go; in every fourth trip it turns the rings
too."""

CAUSES = {Reason.ACROSS_GAP, Reason.AXIS_LIMIT, Reason.AXIS_1, Reason.LINKS}

MOST_TICKS = 30
"""To take the goal to where the hand went; the arm needs many more to go there."""

ROUNDING = 1e-9

TINY = 1e-8
"""[rad/s], [rad/s^2] What planning each tick anew leaves open."""


def tool(chain: Chain, q: FloatArray) -> FloatArray:
    return forward(chain, q)[:3, 3]


def on_branch(chain: Chain, q: FloatArray, branch: Branch, over: float) -> bool:
    """Whether ``q`` is on ``branch``, or its seam, or ``over`` it [m]."""
    arm = arm_of(chain)
    alpha1, _, alpha3, _, _ = arm.canonical(q)
    x, y = arm.pose(forward(chain, q))[:2, 3]
    r = float(x * math.cos(alpha1) + y * math.sin(alpha1))
    outward = r if branch.shoulder == "front" else -r
    bend = math.sin(alpha3) if branch.elbow == "up" else -math.sin(alpha3)
    return bool(bend >= -ROUNDING and outward >= -over)


def on_elbow(chain: Chain, q: FloatArray, branch: Branch) -> bool:
    """Whether ``q`` has the elbow of ``branch``, or none."""
    bend = math.sin(arm_of(chain).canonical(q)[2])
    return (bend if branch.elbow == "up" else -bend) >= -ROUNDING


@dataclasses.dataclass(frozen=True)
class Trip:
    """Where it starts [rad], what a move of the hand adds [m], and moves between grabs.

    turns: how far a move of the rings turns them [rad], 0 where the hand leaves them alone.
    """

    q: FloatArray
    way: FloatArray
    grab: int
    turns: float
    priority: Priority


def trips(chain: Chain, priorities: tuple[Priority, ...], drags: int) -> Iterator[Trip]:
    """A third goes across axis 1, the others anywhere, most of them out of the workspace."""
    T_C_S = arm_of(chain).T_C_S
    size = arm_of(chain).reach
    for number in range(drags // A_TRIP):
        rng = np.random.default_rng([450, number])
        q = rng.uniform(chain.lower, chain.upper)
        way = rng.normal(size=3)
        if number % 3 == 0:
            x, y, _ = T_C_S[:3, :3] @ tool(chain, q) + T_C_S[:3, 3]
            across = np.array([-x, -y, 0.05 * rng.normal()]) + rng.normal(scale=0.02, size=3)
            way = T_C_S[:3, :3].T @ across
        # Mostly slow, some as fast as a hand can.
        length = rng.uniform(0.003, 0.03) * size if number % 20 else (0.1, 0.4)[number // 20 % 2]
        yield Trip(
            q,
            length * way / np.linalg.norm(way),
            GRABS[number % len(GRABS)],
            0.05 if number % 4 == 3 else 0.0,
            priorities[number % len(priorities)],
        )


def drag(chain: Chain, session: Session, trip: Trip, seed: int) -> Iterator[State]:
    """The states after each move of the hand, every tick of them checked."""
    rng = np.random.default_rng([seed, 1])
    state = session.begin(trip.q, 0.0, 0.0)
    state = session.step(state, [cmd.SetPriority(trip.priority)], state.t + TICK)
    branch = state.branch
    target = tool(chain, trip.q)
    limit, turning = 3.0 * arm_of(chain).reach, trip.turns > 0.0
    for number in range(A_TRIP):
        if turning and number % 3 == 2:
            desired = current_target(session.require_arm(), state)
            turn = rng.normal(scale=trip.turns, size=2)
            command: cmd.Command = cmd.TurnTool(desired.pitch + turn[0], desired.roll + turn[1])
        else:
            target = np.clip(target + trip.way, -limit, limit)
            command = cmd.MoveTool(target)
        before = state
        state = check_tick(chain, session, state, command)
        ticks = 1
        while state.since is not None:
            assert ticks < MOST_TICKS
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
    """What counts most of what ``q`` misses of the target, in order."""
    pitch, _ = pitch_and_roll(chain, q)
    position = math.dist(tool(chain, q), target.position)
    if priority is Priority.PITCH:
        return [abs(math.remainder(pitch - target.pitch, math.tau)), position]
    return [position]


def check_goal(chain: Chain, before: State, state: State, target: ToolTarget) -> None:
    """However many hops it took, no move of the hand leads the goal away from its target."""
    was, now = (misses(chain, s.goal, target, state.priority) for s in (before, state))
    for a, b in zip(was, now, strict=True):
        assert b <= a + ROUNDING
        if b < a - ROUNDING:
            break
    assert chain.within_limits(state.goal, slack=0.0)


def check_findings(chain: Chain, state: State, target: ToolTarget) -> None:
    """Whatever is given up is told, and with a cause that a person can act on."""
    reasons = {finding.reason for finding in state.findings}
    given_up = math.dist(tool(chain, state.goal), target.position) > POSITION_WORTH_TELLING
    assert reasons or not given_up
    assert not reasons or reasons & CAUSES


def check_tick(
    chain: Chain,
    session: Session,
    before: State,
    *commands: cmd.Command,
) -> State:
    """A tick: the arm keeps to its speeds, limits and elbow, and the goal to its branch.

    The arm itself has mass: it follows the goal as fast as it may, and turns no corner at once.
    """
    state = session.step(before, commands, before.t + TICK)
    limits = session.require_arm().limits
    dt = TICK * (1 + ROUNDING)
    assert (np.abs(state.setpoint - before.setpoint) <= limits.speed * dt).all()
    assert (np.abs(state.motion.qd - before.motion.qd) <= limits.acceleration * dt + TINY).all()
    assert (np.abs(state.motion.qdd - before.motion.qdd) <= limits.jerk * dt + TINY).all()
    assert chain.within_limits(state.setpoint, slack=0.0)
    if state.goal is not before.goal:
        assert on_branch(chain, state.goal, state.branch, ROUNDING)
    assert on_elbow(chain, state.setpoint, state.branch)
    return state


@pytest.mark.parametrize("priority", Priority)
def test_thousands_of_drags(arm: ArmModel, session: Session, priority: Priority) -> None:
    seen: Counter[Status] = Counter()
    for number, trip in enumerate(trips(arm.chain, (priority,), DRAGS[priority])):
        seen.update(state.status for state in drag(arm.chain, session, trip, number))
    assert sum(seen.values()) == DRAGS[priority]
    # It did go through all of it.
    assert all(
        seen[status] > DRAGS[priority] // 20 for status in (Status.OK, Status.LIMITED, Status.GAP)
    ), seen


def others() -> Iterator[tuple[str, Chain]]:
    """Arms with offsets of every kind, and tool points beside their roll axis."""
    for name in ("pincherx_150", "youbot_arm"):
        yield name, load(ARMS / f"{name}.urdf").require_arm().chain
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        chain, _ = random_member(rng, lateral=seed != 1)
        middle, half = rng.uniform(-0.5, 0.5, 5), rng.uniform(1.0, 2.6, 5)
        limited = dataclasses.replace(chain, lower=middle - half, upper=middle + half)
        yield f"member {seed}", limited
        yield f"member {seed} beside", limited.with_tool(chain.M @ random_pose(rng, 0.02))


@pytest.mark.parametrize("chain", [pytest.param(chain, id=name) for name, chain in others()])
def test_hundreds_of_drags_of_other_arms(chain: Chain) -> None:
    arm = ArmModel(chain, {"tool": chain.M}, "tool", NO_GRIPPER)
    session = Session(arm, 0.5 * (chain.lower + chain.upper))
    seen: Counter[Status] = Counter()
    for number, trip in enumerate(trips(chain, tuple(Priority), OTHERS)):
        seen.update(state.status for state in drag(chain, session, trip, number))
    assert sum(seen.values()) == OTHERS
    assert set(seen) == {Status.OK, Status.LIMITED, Status.GAP}
