"""Rules of a stop: what silence and repeated stops do, and when a stop may be cleared."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from enum import Enum

from katana450.arm.control.commands.commands import HoldFor, PauseFor, Stop
from katana450.arm.control.state.messages import finding_text
from katana450.arm.control.state.modes import IDLE
from katana450.arm.control.state.state import ActiveStop, Finding, Reason, State
from katana450.arm.control.state.stop_cause import StopCause
from katana450.maths.motion.limiter import JointMotion

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


PAUSE_TIMEOUT = 5.0
"""[s] Silence after which a pause becomes a latched stop."""


class SilenceProfile(Enum):
    """Reaction of a moving arm to a silent driver, a silent process or a late control loop.

    The heartbeat timeout is the same in both. The driver in use chooses the profile.
    """

    REAL_ARM = "real arm"
    """The arm stops, and the stop is latched: somebody may stand beside it."""
    SIMULATION = "simulation"
    """The arm pauses: it brakes and drops its targets, and the next command moves it. A program
    keeps its path if only the page's server was silent. Silence of PAUSE_TIMEOUT latches the stop.
    """

    def braking(
        self, cause: Finding, silence: float, *, resumes: bool = False
    ) -> Stop | HoldFor | PauseFor:
        """Return the command for a moving arm after ``silence`` [s], for the reason ``cause``.

        resumes: whether a program drives that may resume by itself.
        """
        if self is SilenceProfile.REAL_ARM or silence >= PAUSE_TIMEOUT:
            return Stop(StopCause(f"{finding_text(cause)}."), cause)
        return PauseFor(cause) if resumes else HoldFor(cause)


RESTARTED = (Finding(Reason.STOPPED), Finding(Reason.RESTARTED))
"""Findings of an arm that waits for Clear stop after its process was started again."""

RESTART_CAUSE = StopCause(f"{finding_text(RESTARTED[1])}.")
"""Cause of that stop."""


def at_rest(state: State) -> State:
    """Return the part of ``state`` that outlasts the process of the arm, at rest and stopped.

    The joints and the gripper keep their place, and all targets are dropped.
    """
    return replace(
        state,
        motion=JointMotion.rest(state.q),
        gripper_setpoint=state.gripper,
        goal=state.q,
        gripper_goal=state.gripper,
        findings=RESTARTED,
        blocked=False,
        stopped=ActiveStop(0.0, 0.0, RESTART_CAUSE),
        paused=False,
        mode=IDLE,
        outcomes=(),
    )


def restarted(first_state: State, last_state: State | None) -> State:
    """Return the first state of a new process, stopped and with the scene of the last state.

    last_state: the last known one of the process before; None if none is known. The place of the
    arm is that of ``first_state``, which its driver reports.
    """
    stopped = at_rest(first_state)
    if last_state is None:
        return stopped
    return replace(
        stopped,
        tool=last_state.tool,
        priority=last_state.priority,
        speed=last_state.speed,
        objects=last_state.objects,
        grip=last_state.grip,
        squeeze=last_state.squeeze,
        poured=last_state.poured,
    )
