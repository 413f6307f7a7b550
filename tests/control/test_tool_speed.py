"""The tool keeps its maximum speed under all commands, and can always brake below it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from katana450.arm.control.arm import ArmModel
from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.plans import plan_to
from katana450.arm.control.session.session import TOOL_SPEED, Session
from katana450.arm.control.session.stopping import clear_refusal
from katana450.arm.control.state.state import State
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.forward import jacobian_body
from katana450.maths.kinematics.velocity import tool_speed, tool_speed_bound
from tests.conftest import LONG

TICK = 0.01

TICKS = 3000 if LONG else 1000

Order = Callable[[np.random.Generator, ArmModel], cmd.Command]


def anywhere(rng: np.random.Generator, arm: ArmModel) -> FloatArray:
    return rng.uniform(arm.chain.lower, arm.chain.upper)


ORDERS: dict[str, list[Order]] = {
    "drags": [lambda rng, _: cmd.Position(rng.uniform(-0.6, 0.6, 3))],
    "streams": [lambda rng, arm: cmd.Servo(anywhere(rng, arm), rng.uniform(-2.0, 2.0, 5))],
    "jogs": [lambda rng, _: cmd.Jog(rng.uniform(-0.5, 0.5, 5))],
    "turns": [lambda rng, _: cmd.Turn(rng.uniform(-2.0, 2.0), rng.uniform(-2.0, 2.0))],
    "joints": [lambda rng, arm: cmd.Joints(anywhere(rng, arm))],
    "pauses": [lambda *_: cmd.Pause(), lambda *_: cmd.Resume(), lambda *_: cmd.Hold()],
    "stops": [lambda *_: cmd.Stop()],
}


def speed(session: Session, state: State) -> float:
    J = jacobian_body(session.require_arm().chain_to(state.tool), state.setpoint)
    return float(np.linalg.norm(J[3:] @ state.motion.qd))


def speeds(session: Session, orders: list[Order], ticks: int, seed: int) -> list[float]:
    """Return the tool speeds [m/s] of ticks with commands at random times, most of them close."""
    rng, speeds_found, wait = np.random.default_rng([450, seed]), [], 0
    state = session.begin(session.ready, 0.0, 0.0)
    for _ in range(ticks):
        commands: list[cmd.Command] = []
        if state.stopped is not None:
            # Without a stop, a command comes at once.
            commands = [] if clear_refusal(state, state.t) else [cmd.ClearStop()]
            wait = 0
        elif wait == 0:
            commands = [orders[rng.integers(len(orders))](rng, session.require_arm())]
            wait = int(rng.integers(60))
        else:
            wait -= 1
        state = session.step(state, commands, state.t + TICK)
        speeds_found.append(speed(session, state))
        assert session.require_arm().chain.within_limits(state.setpoint, slack=0.0)
    return speeds_found


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(3))
def test_all_commands_keep_the_tool_speed(session: Session, seed: int) -> None:
    reached = speeds(session, [order for group in ORDERS.values() for order in group], TICKS, seed)
    assert 0.5 * TOOL_SPEED < max(reached) <= TOOL_SPEED


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", ["joints", "streams"])
def test_repeated_jumps_keep_the_tool_speed(session: Session, kind: str) -> None:
    assert 0.8 * TOOL_SPEED < max(speeds(session, ORDERS[kind], TICKS, 7)) <= TOOL_SPEED


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("size", "longest", "seed"),
    [
        (0.4, 30, 2),
        pytest.param(0.9, 30, 3, marks=pytest.mark.long),
        pytest.param(0.9, 80, 5, marks=pytest.mark.long),
    ],
)
def test_fast_drags_keep_the_tool_speed(
    session: Session, size: float, longest: int, seed: int
) -> None:
    """The target leaps by up to ``size`` [m] every few ticks."""
    rng, wait, fastest = np.random.default_rng([450, seed]), 0, 0.0
    state = session.begin(anywhere(rng, session.require_arm()), 0.0, 0.0)
    for _ in range(2500 if LONG else 500):
        commands: list[cmd.Command] = []
        if wait == 0:
            commands = [cmd.Position(rng.uniform(-size, size, 3))]
            wait = int(rng.integers(1, longest))
        else:
            wait -= 1
        state = session.step(state, commands, state.t + TICK)
        fastest = max(fastest, speed(session, state))
    assert 0.8 * TOOL_SPEED < fastest <= TOOL_SPEED


def test_lower_tool_speed_is_kept(arm: ArmModel, session: Session) -> None:
    slow = Session(arm, session.ready, tool_speed=0.1)
    reached = speeds(slow, [order for group in ORDERS.values() for order in group], TICKS, 1)
    assert 0.05 < max(reached) <= 0.1


def test_leaving_a_plan_keeps_the_tool_speed(arm: ArmModel, session: Session) -> None:
    rng, worst = np.random.default_rng(11), 0.0
    orders: list[cmd.Command] = [cmd.Stop(), cmd.Home(), cmd.Position(np.array([-0.3, 0.3, 0.2]))]
    for number in range(12 if LONG else 6):
        state = session.begin(anywhere(rng, arm), 0.0, 0.0)
        plan = plan_to(arm, None, state, anywhere(rng, arm))
        state = session.step(state, [cmd.Follow(plan)], TICK)
        leave = int(rng.uniform(0.2, 0.8) * plan.duration / TICK)
        for tick in range(leave + 150):
            commands = [orders[number % 3]] if tick == leave else []
            state = session.step(state, commands, state.t + TICK)
            worst = max(worst, speed(session, state))
    assert 0.6 * TOOL_SPEED < worst <= TOOL_SPEED


def test_tool_speed_bound_is_an_upper_bound(arm: ArmModel) -> None:
    rng, chain = np.random.default_rng(3), arm.chain
    for _ in range(500):
        qd = rng.uniform(-1.0, 1.0, 5)
        assert tool_speed(chain, anywhere(rng, arm), qd) <= tool_speed_bound(chain, qd) + 1e-12
