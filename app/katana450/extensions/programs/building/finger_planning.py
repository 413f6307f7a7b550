"""Planning of finger motions by the session's own rules, so that a run does what was planned."""

from __future__ import annotations

import math

from katana450.arm.control.commands import Gripper
from katana450.arm.control.messages import part
from katana450.arm.control.state import Reason, State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import ACTION_TIMEOUT
from katana450.extensions.programs.building.plan_state import TICK, PlanState


def with_fingers(plan: PlanState, position: float) -> State:
    """Return the state at rest after the fingers were moved to ``position`` [rad or m].

    They may end before it on an object that they close on. Raises InputError if something else
    stops them.
    """
    state = plan.after(Gripper(position), round(ACTION_TIMEOUT / TICK))
    if state.gripper_setpoint == state.gripper_goal:
        return state
    unit, scale = finger_unit(plan)
    goal, end = (f"{value / scale:.1f}" for value in (position, state.gripper_setpoint))
    raise InputError(
        f"The fingers would stop at {end} {unit} on their way to {goal} {unit}: "
        f"{_obstacle(plan, state)}"
    )


def finger_unit(plan: PlanState) -> tuple[str, float]:
    """Return the unit of finger positions for people, and its size [m or rad]."""
    return ("mm", 1e-3) if plan.plan_context.arm.gripper.slides else ("deg", math.radians(1.0))


def _obstacle(plan: PlanState, state: State) -> str:
    """Return what stops the fingers in ``state``, and a remedy."""
    contacts = [each.parts for each in state.findings if each.reason is Reason.CONTACT]
    parts = contacts[0] if contacts else None
    world = plan.plan_context.session.world_at(state)
    # Objects that can be held are touched without a finding.
    nearest = None if world is None else world.nearest(state.x_setpoint)
    if parts is None and nearest is not None:
        parts = nearest.parts
    if parts is None:
        return f"they need more than {ACTION_TIMEOUT:g} s. Move them less far."
    names = {each.name for each in state.objects}
    finger, obstacle = sorted(parts, key=lambda name: name in names)
    remedy = "Choose another height or pitch of the hand."
    if obstacle in names:
        remedy = f"Leave more room beside {part(obstacle)}, or come from another side."
    return f"{part(finger)} would meet {part(obstacle)}. {remedy}"
