"""Ticks of a session whose arm follows its setpoint exactly, and a clock for control loops."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from itertools import islice

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.state import State
from katana450.arm.runtime.clock import MonotonicClock

TICK = 0.01
"""[s]"""


class SteppedClock(MonotonicClock):
    """A clock that advances when a loop sleeps, and when the test sets it."""

    def __init__(self, t: float = 100.0) -> None:
        self.t = t

    def now(self) -> float:
        return self.t

    def sleep_until(self, t: float, wake: threading.Event | None = None) -> None:  # noqa: ARG002
        self.t = max(self.t, t)


def states(
    session: Session, state: State, *commands: cmd.Command, every: bool = False
) -> Iterator[State]:
    """Yield the state after each tick, with ``commands`` in the first one, or in ``every`` one."""
    while True:
        state = session.step(state, commands, state.t + TICK)
        state = session.observe(state, state.setpoint, state.gripper_setpoint)
        yield state
        commands = commands if every else ()


def ticked(
    session: Session, state: State, *commands: cmd.Command, ticks: int = 1, every: bool = False
) -> State:
    """Return the state after a number of ticks; the arguments are those of ``states``."""
    return [state, *islice(states(session, state, *commands, every=every), ticks)][-1]


def until_rest(
    session: Session, state: State, *commands: cmd.Command, ticks: int = 2000
) -> list[State]:
    """Return the states after all ticks until the arm rests, of which there are at most ``ticks``.

    The ``commands`` are given in the first one.
    """
    passed = []
    for after in islice(states(session, state, *commands), ticks):
        passed.append(after)
        if not after.moving:
            return passed
    raise AssertionError(f"The arm does not come to rest: {passed[-1].findings}")


def rested(session: Session, state: State, *commands: cmd.Command, ticks: int = 2000) -> State:
    """Return the state in which the arm rests; the arguments are those of ``until_rest``."""
    return until_rest(session, state, *commands, ticks=ticks)[-1]


def settled(session: Session, state: State) -> State:
    """Return the state in which the loose objects rest."""
    for _ in range(2000):
        if not state.objects_move:
            return state
        state = ticked(session, state)
    raise AssertionError("The loose objects do not come to rest.")


def during(session: Session, state: State, seconds: float, *commands: cmd.Command) -> list[State]:
    """Return the states after the ticks of a time [s], with ``commands`` in the first one."""
    return list(islice(states(session, state, *commands), round(seconds / TICK)))
