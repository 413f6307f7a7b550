"""A restored state continues as the run that it was taken from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.arm_report import ArmMode, ArmReport
from katana450.arm.control.state.modes import Idle, Mode
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.extensions.recording.ticks import Digester
from tests.conftest import LONG
from tests.control.test_transitions import BEGINNINGS, beginnings
from tests.ticks import TICK, ticked

__all__ = ["beginnings"]

LATER = 4096.0
"""[s] Time of another run at which a state is restored. A sum with it loses few bits."""


TICKS = 120 if LONG else 40
"""Number of ticks after which a run is compared."""

Beginnings = dict[type[Mode], State]


@pytest.mark.parametrize("mode", BEGINNINGS)
def test_restored_state_continues_to_the_bit(
    shipped: Session, beginnings: Beginnings, mode: type[Mode]
) -> None:
    state = original = beginnings[mode]
    other = ticked(shipped, beginnings[Idle], cmd.Joint(2, 1.0), ticks=15)
    fork = replace(other, t=state.t)
    digester = Digester()
    for number in range(1, TICKS):
        t = state.t + number * TICK
        commands = [] if number > 1 else [cmd.RestoreState(state)]
        original = shipped.step(original, [], t)
        fork = shipped.step(fork, commands, t)
        original, fork = (
            shipped.observe(one, one.setpoint, one.gripper_setpoint) for one in (original, fork)
        )
        assert digester.digest(replace(fork, outcomes=())) == digester.digest(original)
    if state.under_way:
        assert (original.setpoint != state.setpoint).any()


@pytest.mark.parametrize("mode", BEGINNINGS)
def test_times_of_the_state_count_from_the_restoration(
    shipped: Session, beginnings: Beginnings, mode: type[Mode]
) -> None:
    rest, state = beginnings[Idle], beginnings[mode]
    original = ticked(shipped, state, ticks=TICKS)
    fork = ticked(shipped, replace(rest, t=LATER), cmd.RestoreState(state), ticks=TICKS)
    assert fork.t == pytest.approx(LATER + original.t - state.t)
    np.testing.assert_allclose(fork.setpoint, original.setpoint, atol=1e-9)
    assert type(fork.mode) is type(original.mode)


def test_stopped_and_real_arms_are_not_set_back(shipped: Session, beginnings: Beginnings) -> None:
    rest = beginnings[Idle]
    moved = ticked(shipped, rest, cmd.Joint(1, 0.5), ticks=200)
    stopped = ticked(shipped, moved, cmd.Stop(), ticks=20)
    report = ArmReport(ArmMode.HOLDING, moved.t, moved.x)
    for state, why in ((stopped, "clear the stop"), (replace(moved, report=report), "real arm")):
        after = shipped.step(state, [cmd.RestoreState(rest)], state.t + TICK)
        assert why in after.outcomes[0].why
        assert (after.setpoint == state.setpoint).all()


def moving(state: State, **motion: list[float]) -> State:
    arrays = {name: np.array(values) for name, values in motion.items()}
    return replace(state, motion=replace(state.motion, **arrays))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda state: moving(state, q=[9.0, 0.0, 0.0, 0.0, 0.0]), "position of joint 1"),
        (lambda state: moving(state, qd=[0.0, 9.0, 0.0, 0.0, 0.0]), "joint 2"),
        (lambda state: moving(state, qdd=[0.0, 0.0, 1e3, 0.0, 0.0]), "joint 3"),
        (lambda state: moving(state, q=[0.0] * 4), "5 joints"),
        (lambda state: replace(state, goal=np.full(5, np.nan)), "5 joints"),
        (lambda state: replace(state, goal=np.full(5, 7.0)), "goal of joint 1"),
        (lambda state: replace(state, speed=3.0), "speed 3.0"),
        (lambda state: replace(state, gripper_goal=np.inf), "finite"),
        (lambda state: replace(state, tool="spoon"), "spoon"),
    ],
)
def test_state_of_other_limits_is_refused(
    shipped: Session, change: Callable[[State], State], why: str
) -> None:
    state = shipped.begin(shipped.ready, 0.0, 0.0)
    with pytest.raises(InputError, match=why):
        shipped.step(state, [cmd.RestoreState(change(state))], TICK)
    with pytest.raises(InputError, match="State"):
        cmd.RestoreState("state")  # type: ignore[arg-type]
