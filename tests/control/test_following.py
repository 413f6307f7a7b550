"""Plans in the session: on the path and inside every limit, whatever commands come meanwhile."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.plan_follower import MAX_UNCHECKED_PATH
from katana450.arm.control.session.plans import path_to, plan_along, plan_to
from katana450.arm.control.session.session import TOOL_SPEED, Session
from katana450.arm.control.state.modes import JointTarget
from katana450.arm.control.state.state import Reason, State, Status
from katana450.errors import BlockedError, InputError
from katana450.extensions.programs.planning.curve_path import ToolPath
from katana450.extensions.programs.planning.curves import Linear, ToolArc, ToolLine
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.kinematics.branch import branch_of
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget, pitch_and_roll
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.path import joint_derivatives
from katana450.maths.planning.plan import Plan
from tests.conftest import LONG
from tests.control.clearing import cleared
from tests.control.test_contact import clearance
from tests.ticks import TICK, until_rest

SLIGHTLY = 2e-5  # m
LOW = np.radians((30.0, -40.0, 95.0, -20.0, 0.0))
"""Posture with the fingers about 10 cm above the table."""
BEYOND_CUP = LOW - (1.1, 0.0, 0.0, 0.0, 0.0)


@pytest.fixture(scope="module")
def poured(arm: ArmModel) -> Plan:
    """A plan that lifts a cup, carries it along an arc and pours: three paths, with rests."""
    chain = arm.chain
    start = np.radians((-20.0, -75.0, 100.0, -25.0, 0.0))
    branch, point = branch_of(chain, start), ToolTarget.at(chain, start)
    lifted = ToolTarget(point.position + np.array([0.0, 0.0, 0.08]), point.pitch, point.roll)
    lift = ToolPath(chain, ToolLine(point, lifted), branch, start)
    level = Linear(point.pitch, point.pitch), Linear(point.roll, point.roll)
    arc = ToolArc(lifted.position, np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0, *level)
    carry = ToolPath(chain, arc, branch, lift.end)
    carried = ToolTarget.at(chain, carry.end)
    out = ToolTarget(carried.position, carried.pitch, carried.roll + 1.9)
    pour = ToolPath(chain, ToolLine(carried, out), branch, carry.end)
    session = Session(arm, start)
    return plan_along(arm, None, session.begin(start, 0.0, 0.0), [lift, carry, pour])


@pytest.fixture(scope="module")
def round_cup(arm: ArmModel, world: CollisionWorld, guarded: Session) -> Plan:
    """A plan from one side of the cup to the other, where the straight path would hit it."""
    return plan_to(arm, world, guarded.begin(LOW, 0.0, 0.0), BEYOND_CUP, seed=1)


def trace(
    session: Session, state: State, commands: dict[int, list[cmd.Command]], ticks: int
) -> list[State]:
    """Return the states of ``ticks`` ticks, with ``commands`` at some of them."""
    states = []
    for tick in range(ticks):
        state = session.step(state, commands.get(tick, []), state.t + TICK)
        state = session.observe(state, state.setpoint, state.gripper_setpoint)
        states.append(state)
    return states


def check_limits(session: Session, states: list[State]) -> None:
    """Check that finite differences over a tick keep the limits of the derivatives."""
    limits, rounding = session.require_arm().limits, 1e-12
    q = np.array([state.setpoint for state in states])
    for order, limit in enumerate((limits.speed, limits.acceleration, limits.jerk), 1):
        difference = np.abs(np.diff(q, order, axis=0)) / TICK**order
        assert (difference <= limit + rounding / TICK**order).all(), order
    chain = session.require_arm().chain
    points = np.array([forward(chain, posture)[:3, 3] for posture in q])
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).max() <= TOOL_SPEED * TICK + 1e-12
    for before, after in pairwise(states):
        # The reported rates agree with the setpoints.
        mean = 0.5 * (before.motion.qd + after.motion.qd)
        step = after.setpoint - before.setpoint
        assert np.abs(step - TICK * mean).max() <= (limits.jerk * TICK**3 / 12.0).max() + 1e-12


def off_path(states: list[State], plan: Plan) -> float:
    """Return the maximum distance of a setpoint from its reported place on the plan [rad]."""
    worst = 0.0
    for state in states[:: 1 if LONG else 3]:
        assert state.following is not None
        segment = plan.segments[state.following.number]
        sigma = segment.scaling.pace(state.following.local).sigma
        q = np.array([jet.c0 for jet in segment.path.joints(Jet.variable(sigma))])
        worst = max(worst, float(np.abs(q - state.setpoint).max()))
    return worst


def test_plan_is_followed_to_its_end_in_its_duration(session: Session, state: State) -> None:
    goal = np.array([1.0, -0.8, 0.9, 0.5, 1.2])
    plan = plan_to(session.require_arm(), None, state, goal)
    states = until_rest(session, state, cmd.Follow(plan))
    last = states[-1]
    assert (last.setpoint == goal).all()
    assert (last.goal == goal).all()
    assert isinstance(last.target, JointTarget)
    assert last.status is Status.OK
    assert last.branch == branch_of(session.require_arm().chain, goal)
    assert last.following is not None
    assert last.following.fraction == 1.0
    assert len(states) * TICK == pytest.approx(plan.duration, abs=2 * TICK)
    assert off_path(states, plan) <= 1e-15
    check_limits(session, [state, state, state, *states])


def test_cup_stays_level_and_on_its_path_under_any_pacing(
    arm: ArmModel, session: Session, poured: Plan
) -> None:
    """Pauses and changes of speed come at any time."""
    random = np.random.default_rng(11)
    commands: dict[int, list[cmd.Command]] = {0: [cmd.Follow(poured)]}
    for tick in np.cumsum(random.integers(5, 90, 40)).tolist():
        commands[tick] = [
            (
                cmd.Pause(),
                cmd.Resume(),
                cmd.Resume(),
                cmd.Speed(float(random.uniform(0.05, 1.0))),
            )[random.integers(4)]
        ]
    last = max(commands)
    commands[last + 1] = [cmd.Resume(), cmd.Speed(1.0)]
    start = session.begin(poured.start, 0.0, 0.0)
    states = trace(session, start, commands, last + 1100)
    assert states[-1].setpoint == pytest.approx(poured.end, abs=0.0)
    assert not states[-1].moving
    assert off_path(states, poured) <= 1e-15
    check_limits(session, [start, start, start, *states])
    carried = [
        forward(arm.chain, state.setpoint)[:3, 3]
        for state in states
        if state.following is not None and state.following.number == 1
    ]
    lifted = forward(arm.chain, poured.q(poured.begins[1]))[:3, 3]
    for point in carried:
        assert math.hypot(*point[:2]) == pytest.approx(math.hypot(*lifted[:2]), abs=1e-12)
        assert point[2] == pytest.approx(lifted[2], abs=1e-12)
    held = [pitch_and_roll(arm.chain, state.setpoint) for state in states]
    pitch, _ = pitch_and_roll(arm.chain, poured.start)
    assert max(abs(pitch_held - pitch) for pitch_held, _ in held) < 1e-14
    visited = {state.following.number for state in states if state.following is not None}
    assert visited == {0, 1, 2}


def test_plan_from_another_posture_is_refused(session: Session, poured: Plan) -> None:
    state = session.begin(poured.start + np.array([0.0, 0.0, 0.0, 0.0, 0.01]), 0.0, 0.0)
    after = session.step(state, [cmd.Follow(poured)], TICK)
    (finding,) = after.findings
    assert finding.reason is Reason.NOT_AT_START
    assert finding.amount == pytest.approx(0.01)
    assert finding.axis == 4
    assert after.following is None
    assert not after.moving
    returned = session.step(after, [cmd.Joints(poured.start)], 2 * TICK)
    assert returned.findings == ()


def test_plan_for_another_arm_is_refused(arm: ArmModel, session: Session, poured: Plan) -> None:
    S = np.array(arm.chain.S)
    S[3:, 1] += 0.01 * S[[2, 0, 1], 1]
    other = Session(replace(arm, chain=replace(arm.chain, S=S)), session.ready)
    with pytest.raises(InputError, match="another arm"):
        other.check(cmd.Follow(poured))


def test_tool_and_gripper_commands_do_not_end_the_plan(session: Session, poured: Plan) -> None:
    start = session.begin(poured.start, 0.0, 0.0)
    commands: list[cmd.Command] = [cmd.Gripper(0.2), cmd.Tool("grasp"), cmd.EndDrag()]
    states = trace(session, start, {0: [cmd.Follow(poured)], 50: commands}, 900)
    assert (states[-1].setpoint == poured.end).all()
    assert states[-1].gripper_setpoint == 0.2
    assert off_path(states, poured) <= 1e-15


def test_stop_on_a_plan_is_as_fast_as_the_joints_allow(session: Session, poured: Plan) -> None:
    start = session.begin(poured.start, 0.0, 0.0)
    under_way = trace(session, start, {0: [cmd.Follow(poured)]}, 120)[-1]
    stopped = until_rest(session, under_way, cmd.Stop())
    (finding,) = stopped[-1].findings
    assert finding.reason is Reason.STOPPED
    assert len(stopped) * TICK == pytest.approx(finding.time, abs=2 * TICK)
    travel = math.dist(
        *(
            forward(session.require_arm().chain, after.setpoint)[:3, 3]
            for after in (under_way, stopped[-1])
        )
    )
    assert finding.amount == pytest.approx(travel, abs=1e-4)
    assert stopped[0].following is None
    for command in (cmd.Follow(poured), cmd.Resume()):
        after = trace(session, stopped[-1], {0: [command]}, 20)[-1]
        assert (after.setpoint == stopped[-1].setpoint).all()
    free = trace(session, cleared(session, stopped[-1]), {}, 50)[-1]
    assert (free.setpoint == stopped[-1].setpoint).all()


def test_plan_goes_around_the_cup_if_the_straight_path_is_blocked(
    arm: ArmModel, world: CollisionWorld, guarded: Session, round_cup: Plan
) -> None:
    state, plan = guarded.begin(LOW, 0.0, 0.0), round_cup
    assert plan.nearest is not None
    again = path_to(arm, world, state, BEYOND_CUP, seed=1)
    sigma = np.linspace(0.0, 1.0, 50)
    same = joint_derivatives(plan.segments[0].path, sigma) == joint_derivatives(again, sigma)
    assert same.all()
    states = until_rest(guarded, state, cmd.Follow(plan))
    assert (states[-1].setpoint == BEYOND_CUP).all()
    assert not any(state.blocked for state in states)
    near = min(clearance(world, state) for state in states)
    assert near >= MIN_CLEARANCE
    # The reported clearance is accurate to a tenth, and also holds between the ticks.
    assert 0.89 * plan.nearest.contact.distance - 1e-4 <= near
    assert near <= plan.nearest.contact.distance * 1.1 + 1e-3
    check_limits(guarded, [state, state, state, *states])


def test_stop_beside_the_cup_keeps_clear_of_it(
    world: CollisionWorld, guarded: Session, round_cup: Plan
) -> None:
    """A joint-by-joint brake would leave the path, and there is not room for that everywhere."""
    start = guarded.begin(LOW, 0.0, 0.0)
    states = until_rest(guarded, start, cmd.Follow(round_cup))
    along = 0
    for tick in range(64, len(states) - 40, 12 if LONG else 24):
        stopped = until_rest(guarded, states[tick], cmd.Stop())
        along += stopped[0].following is not None
        assert min(clearance(world, state) for state in stopped) >= MIN_CLEARANCE - SLIGHTLY
        assert stopped[-1].motion.at_rest
        check_limits(guarded, [*states[tick - 3 : tick + 1], *stopped])
    assert along > 0
    for tick in range(60, len(states) - 40, 60 if LONG else 120):
        away = trace(guarded, states[tick], {0: [cmd.Home()]}, 100)
        assert min(clearance(world, state) for state in away) >= MIN_CLEARANCE - SLIGHTLY
        assert away[-1].following is None


def test_plan_is_not_clear_with_wider_fingers(
    arm: ArmModel, world: CollisionWorld, guarded: Session
) -> None:
    closed, opened = arm.gripper.closed, arm.gripper.opened
    narrow = guarded.begin(LOW, closed, 0.0)
    beside_cup = until_rest(guarded, narrow, cmd.Joint(1, -0.6))[-1].setpoint
    # As near as the closed fingers can plan to come.
    goal = beside_cup + 0.03 * np.eye(5)[0]
    plan = plan_to(arm, world, narrow, goal)
    assert (until_rest(guarded, narrow, cmd.Follow(plan))[-1].setpoint == goal).all()
    states = until_rest(guarded, guarded.begin(LOW, opened, 0.0), cmd.Follow(plan))
    assert states[-1].status is Status.BLOCKED
    assert min(clearance(world, state) for state in states) >= MIN_CLEARANCE - MAX_UNCHECKED_PATH


def test_obstacle_added_after_planning_is_met_at_rest(
    arm: ArmModel, world: CollisionWorld, guarded: Session
) -> None:
    cup = len(world.parts) - 1
    cupless = CollisionWorld(
        world.linkage, world.parts[:-1], [p for p in world.pairs if cup not in p]
    )
    start = Session(arm, guarded.ready, cupless).begin(LOW, 0.0, 0.0)
    plan = plan_to(arm, cupless, start, BEYOND_CUP)
    states = until_rest(guarded, start, cmd.Follow(plan))
    assert states[-1].status is Status.BLOCKED
    assert "cup" in (states[-1].findings[0].parts or ())
    # Where the plan is not known to be clear, no shorter piece of the path is checked.
    assert min(clearance(world, state) for state in states) >= MIN_CLEARANCE - MAX_UNCHECKED_PATH
    assert off_path(states, plan) <= 1e-15
    # The path onwards is clear without the cup.
    freed = Session(arm, guarded.ready, cupless)
    assert (until_rest(freed, states[-1])[-1].setpoint == BEYOND_CUP).all()


def test_goal_in_the_table_is_refused(
    arm: ArmModel, world: CollisionWorld, guarded: Session
) -> None:
    state = guarded.begin(LOW, 0.0, 0.0)
    with pytest.raises(BlockedError, match=r"table would overlap by .* are required"):
        plan_to(arm, world, state, LOW + np.radians([0.0, 23.0, 0.0, 0.0, 0.0]))


def test_invalid_goal_is_refused(arm: ArmModel, state: State) -> None:
    for goal in (np.full(5, math.nan), np.zeros(4), state.setpoint, np.full(5, 9.0)):
        with pytest.raises(InputError):
            plan_to(arm, None, state, goal)
