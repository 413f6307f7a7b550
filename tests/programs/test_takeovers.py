"""A person takes over from a program at any moment, without a step, a passed limit or a contact."""

from __future__ import annotations

import os
from collections.abc import Iterator

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.state import State
from katana450.extensions.programs.run.runner import Phase
from katana450.extensions.programs.script.script_files import library_file, script_text
from katana450.maths.collision.clearance import MIN_CLEARANCE
from katana450.maths.kinematics.forward import forward
from tests.conftest import LONG
from tests.control.invariants import DT
from tests.control.test_contact import SLIGHTLY, clearance
from tests.programs.conftest import Stage

TAKEOVERS = int(os.environ.get("KATANA450_TAKEOVERS", "100" if LONG else "8"))
"""Number of takeovers from each program."""

TICKS = 60
"""Number of ticks for which the person drives: the brake of the program ends before."""

ROUNDING = 1e-4
"""[1] Rounding of third differences of setpoints, as a fraction of the limit of the jerk."""


def drag(rng: np.random.Generator, stage: Stage, state: State) -> Iterator[cmd.Command]:
    """Yield a command for each tick, of the handle, of Jog, or of a slider."""
    kind, rate = rng.integers(3), rng.normal(size=5)
    begin = forward(stage.plan_context.arm.chain_to(state.tool), state.goal)[:3, 3]
    joint = cmd.Joint(int(rng.integers(1, 6)), float(rng.uniform(-1.0, 1.0)))
    for tick in range(TICKS):
        if kind == 0:
            yield cmd.Position(begin + 0.15 * rate[:3] * DT * tick)
        elif kind == 1:
            yield cmd.Jog(0.2 * np.clip(rate, -1.0, 1.0))
        elif tick == 0:
            yield joint


@pytest.mark.parametrize(
    "name", ["circle_with_gripper", "square", pytest.param("pour", marks=pytest.mark.long)]
)
def test_person_takes_over_at_any_moment(stage: Stage, name: str) -> None:
    start = stage.begin()
    program = stage.planned(script_text(library_file(name)), start)
    run, states = stage.play(program, start)
    assert run.phase is Phase.DONE
    rng, session = np.random.default_rng(7), stage.session
    moving = [number for number in range(3, len(states)) if states[number].moving]
    for number in rng.choice(moving, TAKEOVERS).tolist():
        passed = states[number - 3 : number + 1]
        state = passed[-1]
        world = session.environment.world(state.objects)
        assert world is not None
        least = min(MIN_CLEARANCE, clearance(world, state))
        commands = drag(rng, stage, state)
        for _ in range(TICKS):
            state = session.step(state, [*filter(None, [next(commands, None)])], state.t + DT)
            state = session.observe(state, state.setpoint, state.gripper_setpoint)
            passed.append(state)
        assert state.following is None
        assert stage.loads(passed).max() <= 1.0 + ROUNDING
        # Fingers that close touch what they grasp.
        if passed[0].gripper_goal == passed[0].gripper_setpoint == passed[3].gripper_goal:
            assert min(clearance(world, later) for later in passed[3:]) >= least - SLIGHTLY
