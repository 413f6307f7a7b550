"""Undo of the last changes of the driver: their history, and the requests ``undo`` and ``redo``."""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.lease import Actor
from katana450.arm.control.state.scene_objects import SceneObject, named
from katana450.arm.control.state.state import State
from katana450.errors import InputError
from katana450.server.api import answers, requests
from katana450.server.service.hub import Hub
from katana450.server.service.participants import Participant
from katana450.server.service.runner import RequestHandler

MAX_CHANGES = 20
"""Maximum number of changes that can be undone."""

SAME_GESTURE = 1.0
"""[s] Maximum pause between two commands of one drag, or of one jog."""

OBJECTS = (cmd.PlaceObject, cmd.MoveObject, cmd.Attach, cmd.Remove)


@dataclass(frozen=True)
class Change:
    """A change that can be undone.

    Attributes:
        name: What was changed, in words.
        inverse: The command that restores the earlier value.
        actor: The participant, with the number of revocations at the time of the change.
        at: Time of its last command [s].
    """

    name: str
    inverse: cmd.Command
    actor: Actor
    at: float

    def continues(self, last: Change) -> bool:
        """Return whether this change belongs to the gesture of the change before it."""
        same = (self.name, self.actor.key, self.actor.seen)
        return (last.name, last.actor.key, last.actor.seen) == same and (
            self.at - last.at < SAME_GESTURE
        )


class UndoHistory:
    """The changes that the gate has accepted, the newest last.

    A stop or a change of driver ends the history, because it counts as a revocation.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        """Begin without changes. ``clock`` is in seconds."""
        self._clock = clock
        self._changes: tuple[Change, ...] = ()
        # What was undone since the last change, with the inverses of the undoing.
        self._undone: tuple[Change, ...] = ()
        self.undoes = False
        """Whether the present command undoes a change or repeats one, and is no change itself."""

    def note(self, command: cmd.Command, actor: Actor, state: State, caught_up: bool) -> None:
        """Note what ``command`` of ``actor``, delivered in ``state``, changes.

        ``caught_up``: whether ``state`` includes every earlier command.
        """
        if self.undoes:
            return
        if isinstance(command, cmd.ReplaceScene | cmd.RestoreState):
            self._changes = self._undone = ()
        inverse = _inverse(state, command)
        if inverse is None:
            if any(part.traits.supersedes and not part.traits.protective for part in command.parts):
                # Whatever came before this motion, its undoing would be another leap.
                self._changes = self._undone = ()
            return
        self._undone = ()
        change = Change(*inverse, actor, self._clock())
        last = self._changes[-1] if self._changes else None
        one_gesture = command.traits.stream or command.traits.gesture
        # A state without the last command does not show what this one changes.
        if last is not None and change.continues(last) and (one_gesture or not caught_up):
            self._changes = (*self._changes[:-1], replace(last, at=change.at))
        elif not caught_up:
            self._changes = ()
        elif not isinstance(command, cmd.EndDrag):
            self._changes = (*self._changes, change)[-MAX_CHANGES:]

    def changes(self, key: str, revocations: int, *, redo: bool = False) -> tuple[Change, ...]:
        """Return the changes that the participant of ``key`` can undo or redo, the newest first."""
        changes = []
        for change in reversed(self._undone if redo else self._changes):
            if (change.actor.key, change.actor.seen) != (key, revocations):
                break
            changes.append(change)
        return tuple(changes)

    def inverse(
        self, key: str, revocations: int, state: State, *, redo: bool
    ) -> tuple[Change, cmd.Command]:
        """Return the newest change of the participant of ``key``, and the command that undoes it.

        ``redo``: the newest one that was undone, and the command that repeats it.

        Raises InputError if there is none, if the hand holds the object, or if the hand would open
        on the way.
        """
        changes = self.changes(key, revocations, redo=redo)
        if not changes:
            what = "redo since the last change," if redo else "undo since the last"
            raise InputError(f"There is nothing to {what} stop or change of driver.")
        command = changes[0].inverse
        name = _object_of(command)
        now = None if name is None else named(state.objects, name)
        if now is not None and now.held:
            raise InputError(f"{now.name!r} is held: open the gripper first.")
        holds = any(scene_object.held for scene_object in state.objects)
        if isinstance(command, cmd.Gripper) and holds and state.moving:
            raise InputError("The hand holds an object and the arm moves: wait until it rests.")
        return changes[0], command

    def move(self, change: Change, back: Change | None, *, redo: bool) -> None:
        """Remove ``change``, whose inverse was delivered, and add ``back`` to the other stack."""
        self._changes, self._undone = (
            tuple(other for other in stack if other is not change)
            for stack in (self._changes, self._undone)
        )
        more = () if back is None else (back,)
        if redo:
            self._changes = (*self._changes, *more)[-MAX_CHANGES:]
        else:
            self._undone = (*self._undone, *more)


def _inverse(state: State, command: cmd.Command) -> tuple[str, cmd.Command] | None:
    """Return the name of the change by ``command``, and its inverse; None for no such change."""
    if command.traits.goal:
        return f"arm ({command.traits.goal})", cmd.Joints(state.goal)
    match command:
        case cmd.Gripper():
            return "gripper", cmd.Gripper(state.gripper_goal)
        case cmd.Speed():
            return "speed", cmd.Speed(state.speed)
        case cmd.Tool() if state.tool:
            return "tool", cmd.Tool(state.tool)
        case cmd.SetPriority():
            return "priority", cmd.SetPriority(state.priority)
        case cmd.RestoreState():
            return "continuation", cmd.RestoreState(state)
    name = _object_of(command) if isinstance(command, OBJECTS) else None
    if name is None:
        return None
    before: SceneObject | None = named(state.objects, name)
    if before is None:
        return f"object {name}", cmd.Remove(name)
    if before.held:
        return None
    return f"object {name}", cmd.PlaceObject(before)


def _object_of(command: cmd.Command) -> str | None:
    """Return the name of the object that ``command`` is about; None without one."""
    match command:
        case cmd.PlaceObject(scene_object=scene_object):
            return scene_object.name
        case cmd.MoveObject(name=name) | cmd.Attach(name=name) | cmd.Remove(name=name):
            return name
    return None


class UndoRequests(RequestHandler):
    """Undoes the last change of a participant, and repeats one that was undone."""

    request_types = (requests.Undo, requests.Redo)

    def __init__(self, hub: Hub, _options: Namespace) -> None:
        self.hub = hub
        self.history = UndoHistory(hub.clock)
        hub.gate.delivered.append(self.history.note)

    def handle(self, participant: Participant, request: requests.Request) -> answers.Done:
        """Undo or redo a change of ``participant``. Raises as ``CommandGate.submit`` does."""
        redo, history = isinstance(request, requests.Redo), self.history
        gate, actor = self.hub.gate, replace(participant.actor, seen=request.revocations)
        with gate.lock:
            arm, revocations = gate.check_runs(), gate.revocations
            gate.check_current(actor)
            change, command = history.inverse(actor.key, revocations, arm.state, redo=redo)
            back, inverse = None, _inverse(arm.state, command) if arm.caught_up else None
            if inverse is not None:
                # No later command continues it.
                back = replace(change, inverse=inverse[1], at=-math.inf)
            history.undoes = True
            try:
                ticket = gate.submit(command, actor)
            finally:
                history.undoes = False
            history.move(change, back, redo=redo)
        return answers.Done(ticket=ticket, revocations=revocations)

    def page_status(self, participant: Participant) -> dict[str, Any]:
        """Return the names of what ``participant`` can undo and redo, the newest first."""
        owner = participant.person.key, self.hub.gate.revocations
        changes, undone = self.history.changes(*owner), self.history.changes(*owner, redo=True)
        return {
            "undo": [change.name for change in changes],
            "redo": [change.name for change in undone],
        }
