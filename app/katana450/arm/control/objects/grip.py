"""Grip of the fingers: they close on an object, hold it, lose it or let it go."""

from __future__ import annotations

import math
from dataclasses import replace

from katana450.arm.control.objects.environment import Environment, Hand
from katana450.arm.control.session.goals import without_finding
from katana450.arm.control.state.scene_objects import SceneObject, named, placed
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.maths.physics.model import FingerContact
from katana450.maths.physics.suction import Seal

FINGER_FORCE = 10.0
"""[N] Greatest force of the fingers of one side. Assumed, as the current of a small motor allows.
"""

FIRM = 0.1
"""[N] Force from which a finger counts as touching."""

STALL_RATIO = 0.02
"""[1] Speed of fingers that an object has stopped, as a ratio to their maximum speed."""

SLIDING_SPEED = 0.02
"""[m/s] Speed in the hand from which a held object counts as sliding. When it is lifted it settles
more slowly."""

RELEASE_TURN, RELEASE_SLIDE = 0.02, 1e-3
"""[rad, m] Opening of the fingers from which on an object is free: 1 mm at the pads."""


def gripped(environment: Environment, before: State, state: State, dt: float) -> State:
    """Return ``state`` after fingers and objects have moved in this tick of ``dt`` [s].

    ``before`` is the state after the last tick.
    """
    hand = environment.hand
    if hand is None or not (hand.can_hold and state.objects) or dt <= 0.0:
        return state
    return _crushed(hand, before, _gripped(environment, hand, before, state, dt))


def _crushed(hand: Hand, before: State, state: State) -> State:
    """Return ``state`` with a finding on each object that the fingers have just crushed.

    The lesser force of two ticks counts, because that of an impact lasts for one.
    """
    known = {finding.parts for finding in state.findings if finding.reason is Reason.CRUSHED}
    for item in state.objects if contacts_of(before) and contacts_of(state) else ():
        limit, parts = item.crush_force, (item.name, hand.fingers[0])
        if limit is None or parts in known:
            continue
        both = (contacts_of(before), contacts_of(state))
        force = min(max(side_forces(hand, contacts, item.name)) for contacts in both)
        if force > limit:
            crushed = Finding(Reason.CRUSHED, force, parts=parts, limit=limit)
            state = replace(state, findings=(crushed, *state.findings))
    return state


def _gripped(environment: Environment, hand: Hand, before: State, state: State, dt: float) -> State:
    """Return ``state`` after ``hand`` has closed on an object, held it, let it go or lost it."""
    gripper = hand.gripper
    if state.grip is not None:
        return _holding(environment, hand, before, state, dt)
    if not gripper.is_wider(state.gripper_setpoint, state.gripper_goal):
        opening = gripper.is_wider(state.gripper_goal, state.gripper)
        return without_finding(state, Reason.LOPSIDED, Reason.LEAKING) if opening else state
    moved = abs(state.gripper_setpoint - before.gripper_setpoint)
    is_stopped = moved <= STALL_RATIO * gripper.speed * dt
    if hand.cup is not None:
        return _on_cup(environment, hand, state, is_stopped=is_stopped)
    contacts = contacts_of(state)
    if not (contacts and is_stopped):
        return state
    for scene_object in state.objects:
        if scene_object.can_be_held and not scene_object.fixed:
            forces = side_forces(hand, contacts, scene_object.name)
            if max(forces) >= FIRM:
                return _closed(environment, hand, state, scene_object, forces)
    return state


def contacts_of(state: State) -> tuple[FingerContact, ...]:
    """Return the contacts of the hand."""
    return () if state.bodies is None else state.bodies.contacts


def side_forces(hand: Hand, contacts: tuple[FingerContact, ...], name: str) -> list[float]:
    """Return the normal force of each gripping side of ``hand`` on the object ``name`` [N]."""
    return [
        math.fsum(
            contact.force for contact in contacts if contact.body == name and contact.finger in side
        )
        for side in hand.gripping_sides
    ]


def suction_of(hand: Hand | None, state: State) -> str | None:
    """Return the name of what a suction cup holds; "" if it holds nothing, None if it is off.

    It is off while it opens, and at its open end.
    """
    if hand is None or hand.cup is None:
        return None
    gripper, goal = hand.gripper, state.gripper_goal
    if gripper.is_wider(goal, state.gripper_setpoint) or not gripper.is_wider(gripper.opened, goal):
        return None
    return "" if state.held is None else state.held.name


def _seal_of(state: State) -> Seal | None:
    return None if state.bodies is None else state.bodies.seal


def _on_cup(environment: Environment, hand: Hand, state: State, *, is_stopped: bool) -> State:
    """Return ``state`` with the suction cup on the flat face of an object, or leaking."""
    seal = _seal_of(state)
    item = None if seal is None else named(state.objects, seal.item)
    if seal is None or item is None or not item.can_be_held or item.fixed:
        return state
    if seal.is_tight:
        return _held(environment, _stopped(state), item, 0.0)
    if not is_stopped:
        return state
    leaking = Finding(Reason.LEAKING, seal.gap, parts=(hand.fingers[0], item.name))
    stopped = _stopped(state)
    return replace(stopped, findings=(*stopped.findings, leaking))


def _is_lost(hand: Hand, state: State, name: str) -> bool:
    """Return whether nothing of ``hand`` holds the object ``name`` any more."""
    if hand.cup is None:
        return max(side_forces(hand, contacts_of(state), name)) == 0.0
    seal = _seal_of(state)
    return seal is None or seal.item != name or not seal.is_tight


def _load(hand: Hand, state: State) -> float:
    """Return the load of what ``hand`` holds in ``state`` [N]."""
    load = math.fsum(contact.friction for contact in contacts_of(state))
    if hand.cup is None:
        return load
    # What the pressure does not press against the rim, it bears.
    pressing = math.fsum(contact.force for contact in contacts_of(state))
    return math.hypot(hand.cup.force - pressing, load)


def _holding(environment: Environment, hand: Hand, before: State, state: State, dt: float) -> State:
    """Return ``state`` with the object still held, let go, or lost."""
    gripper, grip, held = hand.gripper, state.grip, state.held
    assert grip is not None
    free = gripper.wider(grip, RELEASE_SLIDE if gripper.slides else RELEASE_TURN)
    if held is None or gripper.is_wider(state.gripper_setpoint, free):
        return _let_go(environment, state)
    state = without_finding(state, Reason.SLIDING)
    # Fingers that open to let the object go need no force.
    if state.bodies is None or gripper.is_wider(state.gripper_goal, free):
        return state
    last = named(before.objects, held.name)
    reason = None
    if _is_lost(hand, state, held.name):
        touched = bool(contacts_of(before))
        # The contacts of a part that its joint keeps from the middle of the fingers can fail for
        # a tick.
        is_first = hand.cup is None and (touched if held.joint is not None else not touched)
        if before.grip is None or before.bodies is None or is_first:
            # The fingers have only begun to press on it.
            return state
        state, reason = _let_go(environment, state), Reason.SLIPPED
    elif last is not None and last.held and _way(last, held) > SLIDING_SPEED * dt:
        reason = Reason.SLIDING
    if reason is None:
        return state
    limit = 0.0 if hand.cup is None else hand.cup.force
    cause = Finding(reason, _load(hand, before), parts=(held.name, hand.fingers[0]), limit=limit)
    return replace(state, findings=(cause, *state.findings))


def _way(before: SceneObject, now: SceneObject) -> float:
    """Return how far [m] a held object has moved in the hand."""
    return 0.0 if before is now else float(abs(now.T[:3, 3] - before.T[:3, 3]).max())


def finger_forces(hand: Hand, state: State) -> dict[str, float]:
    """Return the normal force on objects of each part of the gripping sides of ``hand`` [N]."""
    forces = dict.fromkeys((part for side in hand.gripping_sides for part in side), 0.0)
    for contact in contacts_of(state):
        if contact.finger in forces:
            forces[contact.finger] += contact.force
    return forces


def touching(hand: Hand | None, state: State) -> tuple[str, ...]:
    """Return the names of the parts of ``hand`` that touch an object."""
    if hand is None:
        return ()
    if state.held is not None and state.bodies is None:
        # Nothing has moved since the arm's process was started again.
        return hand.fingers
    touched = {contact.finger for contact in contacts_of(state)}
    return tuple(name for side in hand.gripping_sides for name in side if name in touched)


def _let_go(environment: Environment, state: State) -> State:
    """Return ``state`` with an empty hand, and the held object free where it is."""
    x = state.x_setpoint
    objects = tuple(
        replace(scene_object, T=environment.pose(scene_object, x), held=False)
        if scene_object.held
        else scene_object
        for scene_object in state.objects
    )
    return replace(state, objects=objects, grip=None, squeeze=0.0)


def _closed(
    environment: Environment,
    hand: Hand,
    state: State,
    scene_object: SceneObject,
    forces: list[float],
) -> State:
    """Return ``state`` with the fingers stopped by ``scene_object``.

    They hold it if both sides press on it with ``forces`` [N].
    """
    stopped = _stopped(state)
    weakest = min(range(len(forces)), key=forces.__getitem__)
    if forces[weakest] < FIRM:
        parts = (hand.gripping_sides[weakest][0], scene_object.name)
        world = environment.world(state.objects)
        assert world is not None
        gap = world.gap(state.x_setpoint, scene_object.name, *hand.gripping_sides[weakest])
        lopsided = Finding(Reason.LOPSIDED, gap, parts=parts)
        return replace(stopped, findings=(*stopped.findings, lopsided))
    squeeze = abs(state.gripper_setpoint - state.gripper_goal)
    return _held(environment, stopped, scene_object, squeeze)


def _stopped(state: State) -> State:
    """Return ``state`` with the fingers stopped where they are."""
    state = without_finding(state, Reason.CONTACT, Reason.LOPSIDED)
    return replace(state, gripper_goal=state.gripper_setpoint, blocked=False)


def _held(environment: Environment, state: State, item: SceneObject, squeeze: float) -> State:
    """Return ``state`` with ``item`` in the hand, pressed with the preload ``squeeze``."""
    objects = placed(state.objects, environment.taken(item, state.x_setpoint))
    return replace(state, objects=objects, grip=state.gripper_setpoint, squeeze=squeeze)
