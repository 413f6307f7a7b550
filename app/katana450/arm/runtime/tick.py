"""One tick of the control loop as a pure function, and its record.

The loop and the simulation of a recording call the same functions, so both mean the same by a tick.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from katana450.arm.control.commands.commands import Command, RestoreState
from katana450.arm.control.lease import Actor
from katana450.arm.control.session.checks import FAILED
from katana450.arm.control.session.session import Session
from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.state import ACCEPTED, Finding, Reason, State
from katana450.arm.drivers.driver import DriverAnswer
from katana450.maths.motion.limiter import JointMotion

Send = Callable[..., DriverAnswer]
"""Gives a setpoint to the driver and returns its answer, as ``Driver.send``."""


class Submission(NamedTuple):
    """A command and its giver; None where the process of the arm acts by itself."""

    command: Command
    actor: Actor | None


class TickRecord(NamedTuple):
    """One tick: its input, and the state after it.

    Attributes:
        t_before: time of the state that it stepped from [s]; that of the tick before, or later if
            the arm rested until a command came.
        t: time of the tick [s].
        submissions: its commands as taken from the mailbox, with who gave each.
        failed: whether an internal error made the arm hold.
        state: the state after it, with the driver's answer in ``q`` and ``gripper``.
        named: whether a later copy of a press of STOP named its presser in ``state``.
    """

    t_before: float
    t: float
    submissions: Sequence[Submission]
    failed: bool
    state: State
    named: bool = False


def stepped(session: Session, state: State, commands: list[Command], t: float, send: Send) -> State:
    """Return the state after a tick from ``state`` at ``t`` [s].

    Raises any error of the session, and of ``send``.
    """
    return driven(session, session.step(state, commands, t), t, send)


def restores(commands: Sequence[Command], state: State) -> bool:
    """Return whether the tick that ended in ``state`` accepted a state of an earlier run."""
    return any(
        isinstance(command, RestoreState) and outcome is ACCEPTED
        for command, outcome in zip(commands, state.outcomes, strict=True)
    )


def driven(session: Session, state: State, t: float, send: Send) -> State:
    """Return ``state`` with the answer of the driver to its setpoint at ``t`` [s]."""
    return _observed(session, state, _sent(state, t, send))


def failed(state: State, commands: list[Command]) -> State:
    """Return the state after a tick from ``state`` in which an error occurred.

    The arm holds, and all targets are dropped.
    """
    return replace(
        state,
        motion=JointMotion.rest(state.setpoint),
        goal=state.setpoint,
        gripper_goal=state.gripper_setpoint,
        mode=IDLE,
        findings=(Finding(Reason.INTERNAL),),
        outcomes=(FAILED,) * len(commands),
    )


def waited(session: Session, state: State, t: float, send: Send) -> State:
    """Return ``state`` itself after a tick at ``t`` [s] in which nothing was to do.

    If the driver reports another place, the state has it, and the time.
    """
    answer = _sent(state, t, send)
    if answer.q is state.q and answer.gripper == state.gripper and answer.report is state.report:
        return state
    return _observed(session, replace(state, t=t), answer)


def _sent(state: State, t: float, send: Send) -> DriverAnswer:
    return send(state.setpoint, state.gripper_setpoint, t, state.stopped is not None)


def _observed(session: Session, state: State, answer: DriverAnswer) -> State:
    state = session.observe(state, answer.q, answer.gripper)
    return state if answer.report is None else session.supervised(state, answer.report)
