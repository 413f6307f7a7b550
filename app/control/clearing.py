"""The step of one tick: towards the goals, at the joints' speed, and clear of every contact."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.collision.clearance import advance
from app.collision.contact import Contact
from app.collision.world import World
from app.control.arm import Arm
from app.control.state import Finding, Reason, State
from app.geometry.arrays import frozen
from app.motion.approach import approach

CONTACT_WORTH_TELLING = 0.015
"""[m] Slowing down farther away than this is no news; what the arm waits for always is."""


def moved(arm: Arm, world: World | None, state: State, dt: float) -> State:
    """``state`` with its setpoints moved on by ``dt`` [s], as far as ``world`` leaves room."""
    if dt <= 0.0:
        return state
    if not state.under_way:
        return replace(state, stopped=False)
    q, finger = state.setpoint, state.gripper_setpoint
    q_next = approach(q, state.goal, arm.chain.speed, dt)
    reach = arm.gripper.speed * dt
    finger_next = finger + min(max(state.gripper_goal - finger, -reach), reach)
    if world is None:
        return replace(state, setpoint=q_next, gripper_setpoint=finger_next)
    # One after the other: fingers that cannot open must not hold the arm, nor the arm the fingers.
    limb = advance(world, np.append(q, finger), np.append(q_next, finger), dt)
    hand = advance(world, limb.x, np.append(limb.x[:-1], finger_next), dt)
    # An arm that waits keeps the very arrays it has: nothing new is published.
    at_rest = bool((limb.x[:-1] == q).all())
    after = replace(
        state,
        setpoint=q if at_rest else frozen(hand.x[:-1]),
        gripper_setpoint=float(hand.x[-1]),
        stopped=at_rest and bool(hand.x[-1] == finger),
    )
    contact = limb.contact or hand.contact
    worth_telling = contact is not None and (
        limb.stopped or hand.stopped or contact.distance < CONTACT_WORTH_TELLING
    )
    return _told(after, contact if worth_telling else None)


def _told(state: State, contact: Contact | None) -> State:
    """``state`` with ``contact`` as its first finding, in place of any before it."""
    others = tuple(finding for finding in state.findings if finding.reason is not Reason.CONTACT)
    if contact is None:
        return state if others == state.findings else replace(state, findings=others)
    finding = Finding(Reason.CONTACT, contact.distance, parts=contact.parts)
    return replace(state, findings=(finding, *others))
