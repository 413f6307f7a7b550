"""Contact of the fingers: an object between both is held, until they open or it slides out."""

from __future__ import annotations

from dataclasses import replace

from katana450.arm.control.objects.environment import Environment, Hand
from katana450.arm.control.objects.support import surface_below
from katana450.arm.control.session.goals import without_finding
from katana450.arm.control.state.scene_objects import SceneObject, placed
from katana450.arm.control.state.state import Finding, Reason, State
from katana450.maths.collision.world import CollisionWorld

TOUCH_DISTANCE = 3e-4
"""[m] Distance up to which a finger touches: the sensors in the pads yield by as much."""

CENTRING_DISTANCE = 3e-3
"""[m] Distance of the second finger up to which the object slides to the middle when the first
finger touches it."""

RELEASE_TURN, RELEASE_SLIDE = 0.02, 1e-3
"""[rad, m] Opening of the fingers from which on an object is free: 1 mm at the pads."""


def gripped(
    environment: Environment, world: CollisionWorld | None, state: State, dt: float
) -> State:
    """Return ``state`` after the motion of the fingers in this tick of ``dt`` [s]."""
    hand = environment.hand
    if world is None or hand is None or not (hand.can_hold and state.objects):
        return state
    gripper = hand.gripper
    if (grip := state.grip) is not None:
        free = gripper.wider(grip, RELEASE_SLIDE if gripper.slides else RELEASE_TURN)
        if gripper.is_wider(state.gripper_setpoint, free):
            return _let_go(environment, state)
        if any(finding.reason is Reason.SLIDING for finding in state.findings):
            state = without_finding(state, Reason.SLIDING)
        # Fingers that open to let the object go need no force.
        opening = gripper.is_wider(state.gripper_goal, free)
        load = None if opening or hand.grip_model is None else hand.grip_model.overload(state)
        if load is None or state.held is None or hand.grip_model is None:
            return state
        held, slid = state.held, hand.grip_model.slid(state, dt)
        reason = Reason.SLIPPED if slid is None else Reason.SLIDING
        cause = Finding(reason, load, parts=(held.name, hand.fingers[0]))
        if slid is None:
            state = _let_go(environment, state)
        else:
            objects = tuple(slid if other is held else other for other in state.objects)
            state = replace(state, objects=objects)
        return replace(state, findings=(cause, *state.findings))
    if not gripper.is_wider(state.gripper_setpoint, state.gripper_goal):
        opening = gripper.is_wider(state.gripper_goal, state.gripper)
        return without_finding(state, Reason.LOPSIDED) if opening else state
    x = state.x_setpoint
    for scene_object in state.objects:
        if scene_object.can_be_held and not scene_object.fixed:
            felt = {side[0]: world.gap(x, scene_object.name, *side) for side in hand.sides}
            if min(felt.values()) <= TOUCH_DISTANCE:
                if (jaw := hand.fixed_jaw) is not None:
                    name, felt[name], moved = jaw.met(world, state, scene_object)
                    if moved is not None:
                        return replace(state, objects=placed(state.objects, moved), blocked=False)
                return _closed(environment, state, scene_object, felt)
    return state


def touching(hand: Hand | None, state: State) -> tuple[str, ...]:
    """Return the fingers that touch an object, judged by the result of their closing."""
    if hand is None:
        return ()
    if any(scene_object.held for scene_object in state.objects):
        return hand.fingers
    away = [finding.parts for finding in state.findings if finding.reason is Reason.LOPSIDED]
    near = [side for parts in away if parts for side in hand.sides if side[0] not in parts]
    return tuple(name for side in near for name in side)


def _let_go(environment: Environment, state: State) -> State:
    """Return ``state`` with an empty hand and the held object below it."""
    x = state.x_setpoint

    def released(held: SceneObject) -> SceneObject:
        lifted = replace(held, T=environment.pose(held, x), held=False)
        return environment.left(held, x, surface_below(state.objects, lifted))

    objects = tuple(
        released(scene_object) if scene_object.held else scene_object
        for scene_object in state.objects
    )
    return replace(state, objects=objects, grip=None, squeeze=0.0)


def _closed(
    environment: Environment, state: State, scene_object: SceneObject, felt: dict[str, float]
) -> State:
    """Return ``state`` with the fingers closed on ``scene_object``.

    The fingers stop, and they hold the object if both sides touch it. ``felt``: the distance of
    each side from it [m].
    """
    state = without_finding(without_finding(state, Reason.CONTACT), Reason.LOPSIDED)
    stopped = replace(state, gripper_goal=state.gripper_setpoint, blocked=False)
    far = max(felt, key=lambda finger: felt[finger])
    if felt[far] > CENTRING_DISTANCE:
        lopsided = Finding(Reason.LOPSIDED, felt[far], parts=(far, scene_object.name))
        return replace(stopped, findings=(*stopped.findings, lopsided))
    objects = placed(state.objects, environment.taken(scene_object, state.x_setpoint))
    squeeze = abs(state.gripper_setpoint - state.gripper_goal)
    return replace(stopped, objects=objects, grip=state.gripper_setpoint, squeeze=squeeze)
