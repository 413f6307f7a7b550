"""Tests of a person who moves the arm while a program drives it: there is no step in its motion."""

from __future__ import annotations

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.maths.kinematics.forward import forward
from tests.conftest import LONG
from tests.programs.conftest import TICK, Stage
from tests.programs.test_continuation import SCRIPT

TAKEOVERS = 10_000 if LONG else 8
TICKS_AFTER = 60


def commands_of(stage: Stage, rng: np.random.Generator, q: np.ndarray) -> list[cmd.Command]:
    """Return the commands of one gesture from the posture ``q`` (5,) [rad], one for each tick."""
    kind = rng.integers(3)
    if kind == 0:
        rates = rng.uniform(-1.0, 1.0, 5) * (0.2, 0.2, 0.2, 0.5, 0.5)
        return [cmd.Jog(rates)] * TICKS_AFTER
    if kind == 1:
        return [cmd.Joint(2, rng.uniform(-2.0, 0.1))]
    T = forward(stage.plan_context.arm.chain_to("tcp"), q)
    ends = T[:3, 3] + rng.uniform(-0.1, 0.1, 3)
    return [
        cmd.Position((1.0 - share) * T[:3, 3] + share * ends)
        for share in np.linspace(0.0, 1.0, TICKS_AFTER)
    ]


def test_motion_keeps_its_limits_when_a_person_takes_over(stage: Stage) -> None:
    rng = np.random.default_rng(450)
    program = stage.planned(SCRIPT)
    _, states = stage.play(program, stage.begin())
    moments = [
        number
        for number, state in enumerate(states[3:], 3)
        if state.following is not None and not state.motion.at_rest
    ]
    assert len(moments) > 100
    for _ in range(TAKEOVERS):
        moment = moments[rng.integers(len(moments))]
        state = states[moment]
        # The gate holds the arm first; both may be in one tick.
        gesture = commands_of(stage, rng, state.setpoint)
        ticks: list[list[cmd.Command]] = [[command] for command in gesture]
        ticks[0:0] = [[cmd.Hold()]] * int(rng.integers(2))
        ticks[0].insert(0, cmd.Hold())
        # With the ticks before, so that a step at the first of the person would be seen.
        after = states[moment - 3 : moment + 1]
        for number in range(TICKS_AFTER):
            commands = ticks[number] if number < len(ticks) else []
            state = stage.session.step(state, commands, state.t + TICK)
            state = stage.session.observe(state, state.setpoint, state.gripper_setpoint)
            after.append(state)
        assert stage.loads(after).max() <= 1.0 + 1e-6
        assert all(stage.plan_context.arm.chain.within_limits(state.setpoint) for state in after)
