"""How a state comes to another goal, and what it leaves behind by that."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.control.commands import Dress, SetAxes, SetJoint, Shift
from app.control.looks import Look
from app.control.state import Finding, JointTarget, Reason, State, Target
from app.control.things import Thing
from app.geometry.arrays import FloatArray, frozen


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


def turned(state: State, command: SetJoint | SetAxes) -> JointTarget:
    """Some axes to other angles, the rest to where they were going."""
    q = np.array(state.goal)
    for axis, value in (
        ((command.axis, command.value),) if isinstance(command, SetJoint) else command.values
    ):
        q[axis] = value
    return JointTarget(frozen(q))


def removed(state: State, name: str) -> State:
    """Without the thing of that name, and what it looked like; what is held stays."""
    things = tuple(each for each in state.things if each.held or each.name != name)
    if any(each.name == name for each in things):
        return state
    return replace(state, things=things, looks=state.looks.without(name))


def shifted(state: State, shift: Shift) -> State:
    """With the thing elsewhere, unless it is held."""

    def there(thing: Thing) -> Thing:
        if thing.name != shift.name or thing.held:
            return thing
        T = np.array(thing.T)
        if shift.position is not None:
            T[:3, 3] = shift.position
        if shift.R is not None:
            T[:3, :3] = shift.R
        return replace(thing, T=T)

    return replace(state, things=tuple(map(there, state.things)))


def look_of(state: State, name: str) -> Look:
    """How the link or thing of that name is shown."""
    return state.looks.of(name)


def dressed(state: State, dress: Dress) -> State:
    """With one trait of a look changed."""
    return replace(state, looks=state.looks.having(dress.name, dress.trait, dress.value))
