"""How a state comes to another goal, and what it leaves behind by that."""

from __future__ import annotations

from dataclasses import replace

from app.control.state import Finding, Reason, State, Target
from app.geometry.arrays import FloatArray


def gone(state: State, target: Target, goal: FloatArray, findings: tuple[Finding, ...]) -> State:
    """With ``goal`` as near to ``target`` as the arm will go, for the reasons ``findings``."""
    kept = tuple(f for f in state.findings if f.reason is Reason.GRIPPER_LIMIT)
    paused = tuple(f for f in state.findings if f.reason is Reason.PAUSED)
    # What the arm brakes for stays the reason, however often it is told anew meanwhile.
    met = tuple(f for f in state.findings if f.reason is Reason.CONTACT and state.blocked)
    aimed = replace(
        state,
        target=target,
        goal=goal,
        findings=paused + met + findings + kept,
        since=None,
        let_go=False,
        jogging=None,
        servo=None,
    )
    return leaving(aimed)


def without(state: State, reason: Reason) -> State:
    """``state`` with no finding of that ``reason``."""
    return replace(state, findings=tuple(f for f in state.findings if f.reason is not reason))


def leaving(state: State) -> State:
    """``state`` that follows a plan no longer than it takes to leave it."""
    if state.following is None:
        return state
    return replace(state, following=replace(state.following, leaving=True))
