"""Clear a stop as soon as the session allows it."""

from __future__ import annotations

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.session.stopping import clear_refusal
from katana450.arm.control.state.state import State
from tests.ticks import TICK, ticked


def cleared(session: Session, state: State) -> State:
    """Return the state after ticks without commands until the stop may be cleared, and its end."""
    for _ in range(1000):
        if not clear_refusal(state, state.t):
            break
        state = ticked(session, state)
    else:
        raise AssertionError(clear_refusal(state, state.t))
    state = session.step(state, [cmd.ClearStop()], state.t + TICK)
    assert state.stopped is None
    return state
