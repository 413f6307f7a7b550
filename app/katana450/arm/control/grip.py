"""What the fingers feel: a thing between both is held, and let go when they open."""

from __future__ import annotations

from dataclasses import replace

from katana450.arm.control.aims import without_finding
from katana450.arm.control.state import Finding, Reason, State
from katana450.arm.control.things import Environment, Hand, Thing
from katana450.maths.collision.world import World
from katana450.maths.geometry.arrays import FloatArray

TOUCHING = 3e-4
"""[m] A finger that is no farther touches: as far as the sensors in the pads are soft."""

CENTRED = 3e-3
"""[m] When one finger touches and the other is no farther, the thing slides between them."""

OPENED_TURN, OPENED_SLIDE = 0.02, 1e-3
"""[rad, m] By as much the fingers open before what they held is free: 1 mm at the pads."""


def gripped(surroundings: Environment, world: World | None, state: State) -> State:
    """``state`` after what the fingers did in this tick."""
    hand = surroundings.hand
    if world is None or hand is None or not (hand.fingers and state.things):
        return state
    x = state.x_setpoint
    if state.grip is not None:
        opened = OPENED_SLIDE if hand.slides else OPENED_TURN
        if state.gripper_setpoint <= state.grip + opened:
            return state
        things = tuple(surroundings.left(t, x) if t.held else t for t in state.things)
        return replace(state, things=things, grip=None)
    if state.gripper_goal >= state.gripper_setpoint:
        return (
            without_finding(state, Reason.LOPSIDED) if state.gripper_goal > state.gripper else state
        )
    for thing in state.things:
        if thing.can_be_held and not thing.fixed:
            felt = _felt(hand.fingers, world, thing, x)
            if min(felt.values()) <= TOUCHING:
                return _closed(surroundings, state, thing, felt, x)
    return state


def touching(hand: Hand | None, state: State) -> tuple[str, ...]:
    """The fingers that feel a thing, by what became of it when they closed."""
    if hand is None:
        return ()
    if any(thing.held for thing in state.things):
        return hand.fingers
    away = [finding.parts for finding in state.findings if finding.reason is Reason.LOPSIDED]
    return tuple(each for parts in away if parts for each in hand.fingers if each not in parts)


def _felt(fingers: tuple[str, ...], world: World, thing: Thing, x: FloatArray) -> dict[str, float]:
    """How far each finger is from ``thing`` [m]."""
    return {finger: world.gap(x, finger, thing.name) for finger in fingers}


def _closed(
    surroundings: Environment, state: State, thing: Thing, felt: dict[str, float], x: FloatArray
) -> State:
    """The fingers have closed on ``thing``: they stop there, and hold it if both have."""
    state = without_finding(without_finding(state, Reason.CONTACT), Reason.LOPSIDED)
    stopped = replace(state, gripper_goal=state.gripper_setpoint, blocked=False)
    far = max(felt, key=lambda finger: felt[finger])
    if felt[far] > CENTRED:
        lopsided = Finding(Reason.LOPSIDED, felt[far], parts=(far, thing.name))
        return replace(stopped, findings=(*stopped.findings, lopsided))
    taken = surroundings.taken(thing, x)
    things = tuple(taken if each is thing else each for each in state.things)
    return replace(stopped, things=things, grip=state.gripper_setpoint)
