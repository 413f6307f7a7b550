"""Rules of a stop: what repeated stops change, and when a stop may be cleared."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from katana450.arm.control.commands.commands import Stop
from katana450.arm.control.state.state import State
from katana450.arm.control.state.stop_cause import StopCause

HOLD_OFF = 1.0
"""[s] Time after the newest STOP in which it cannot be cleared."""

REPORTED_PRESSES = 16
"""Number of presses of STOP in a state: more than people make while a copy is under way."""


def clear_refusal(state: State, t: float, known: float = math.inf) -> str:
    """Return why the stop of ``state`` cannot be cleared at ``t`` [s]; an empty text if it can.

    Without a stop there is nothing to refuse.

    Args:
        state: the state.
        t: now [s], on the clock of ``state.t``.
        known: time of the newest STOP that the person knows who clears it [s].
    """
    if state.stopped is None:
        return ""
    if state.stopped.newest > known:
        return f"{state.stopped.cause.why} You may not know yet. Clear the stop if it is safe."
    if state.report is not None and not state.report.mode.follows:
        return state.report.note or "The arm does not follow its setpoints."
    if not state.motion.at_rest or state.moving:
        return "The arm still brakes. Clear the stop when it is at rest."
    remaining = HOLD_OFF - (t - state.stopped.newest)
    if remaining > 0.0:
        return f"The arm was stopped just now. Clear the stop in {remaining:.1f} s."
    return ""


def with_presses(state: State, stop: Stop) -> State:
    """Return ``state`` with the presses of ``stop`` among its newest ones."""
    presses = (*state.presses, *stop.presses)
    return replace(state, presses=presses[-REPORTED_PRESSES:]) if stop.presses else state


def stopped_again(state: State) -> State:
    """Return the stopped ``state`` after another STOP: only the time until it may be cleared."""
    if state.stopped is None:
        return state
    return replace(state, stopped=replace(state.stopped, newest=state.t))


def with_name(state: State, copies: Iterable[StopCause]) -> State:
    """Return ``state`` with the name of its presser, if one of ``copies`` of the press has it.

    The process of STOP knows no names of pages. The server knows them, and its copy comes later.
    """
    for copy in copies:
        if state.stopped is not None and state.stopped.cause.lacks_name_of(copy):
            cause = replace(copy, at=state.stopped.cause.at)
            state = replace(state, stopped=replace(state.stopped, cause=cause))
    return state


def joined(first: Stop, second: Stop) -> Stop:
    """Return ``first`` as the stop that also fulfils ``second``, which came next."""
    cause, others = first.cause, (*first.others, *second.presses)
    if not second.cause.press:
        # A stop without a name always counts, so the two together do too.
        cause, others = replace(cause, press=""), (cause.press, *others)
    return Stop(cause, first.finding, others[-REPORTED_PRESSES:])
