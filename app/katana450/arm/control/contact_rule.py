"""The rule of contacts: a step is taken only if the path of the brake behind it is clear."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from katana450.arm.control.state import Finding, Reason, State
from katana450.maths.collision.clearance import MIN_STOP_TIME, advance, is_surely_clear
from katana450.maths.collision.contact import Contact
from katana450.maths.collision.world import MAX_PATH_LENGTH, CollisionWorld
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.motion.limiter import JointMotion, Limiter

PROBE_LENGTH = 0.02
"""[rad] Length of path that must be clear before a waiting arm continues. After a shorter probe the
arm would only come back to where it was."""


def met_before_rest(
    world: CollisionWorld, limiter: Limiter, x: FloatArray, ahead: JointMotion
) -> Contact | None:
    """Return the contact on the path to ``ahead`` and from there to rest; None if it is clear.

    x: (k,) the joints (n,), followed by what stays as it is [rad or m]. The distance in the contact
    is that at ``x``.
    """
    here, others = x[: ahead.q.size], x[ahead.q.size :]
    if is_surely_clear(world, x, np.append(limiter.stopping_point(ahead), others)):
        return None
    still = np.zeros(others.size)
    path = limiter.stopping_path(
        ahead, MAX_PATH_LENGTH, lambda change: world.linkage.turned(np.append(change, still))
    )
    for a, b in pairwise([here, *path]):
        step = advance(world, np.append(a, others), np.append(b, others), MIN_STOP_TIME)
        if step.contact is not None or step.stopped:
            return world.nearest(x) if step.contact is None else measured(world, step.contact, x)
    return None


def measured(world: CollisionWorld, met: Contact, x: FloatArray) -> Contact:
    """Return ``met`` with the distance of its parts at ``x`` (k,) [rad or m]."""
    return replace(met, distance=world.gap(x, *met.parts))


def may_go_on(world: CollisionWorld, state: State) -> bool:
    """Return whether the first part of the straight path of a waiting arm to its goal is clear."""
    change = state.goal - state.setpoint
    if not change.any():
        return True
    fraction = min(1.0, PROBE_LENGTH / float(np.abs(change).sum()))
    x = state.x_setpoint
    towards = np.append(state.setpoint + fraction * change, state.gripper_setpoint)
    step = advance(world, x, towards, MIN_STOP_TIME)
    return bool((step.x == towards).all())


def with_distance(world: CollisionWorld, state: State) -> State:
    """Return ``state`` with the present distance in the contact that the arm brakes for."""
    x = state.x_setpoint
    findings = tuple(
        replace(finding, amount=world.gap(x, *finding.parts))
        if finding.reason is Reason.CONTACT and finding.parts is not None
        else finding
        for finding in state.findings
    )
    return replace(state, findings=findings)


def with_contact(state: State, contact: Contact | None) -> State:
    """Return ``state`` with ``contact`` as its first finding, in place of any earlier contact."""
    others = tuple(finding for finding in state.findings if finding.reason is not Reason.CONTACT)
    if contact is None:
        return state if others == state.findings else replace(state, findings=others)
    finding = Finding(Reason.CONTACT, contact.distance, parts=contact.parts)
    return replace(state, findings=(finding, *others))
