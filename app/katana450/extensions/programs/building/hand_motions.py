"""Motions of the fingers, and of the hand to an object and with it.

The session's own rules move the fingers, so that a run does what was planned.
"""

from __future__ import annotations

import math

import numpy as np

from katana450.arm.control.commands.commands import Gripper
from katana450.arm.control.state.messages import part
from katana450.arm.control.state.state import Reason, State
from katana450.errors import InputError
from katana450.extensions.programs.building.actions import ACTION_TIMEOUT
from katana450.extensions.programs.building.plan_state import TICK, PlanState
from katana450.extensions.programs.planning.approach import UP
from katana450.extensions.programs.planning.curves import Curve, arc_between, line_between
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.plan import JOIN_TOLERANCE


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
    contacts = [entry.parts for entry in state.findings if entry.reason is Reason.CONTACT]
    parts = contacts[0] if contacts else None
    world = plan.plan_context.session.world_at(state)
    # Objects that can be held are touched without a finding.
    nearest = None if world is None else world.nearest(state.x_setpoint)
    if parts is None and nearest is not None:
        parts = nearest.parts
    if parts is None:
        return f"they need more than {ACTION_TIMEOUT:g} s. Move them less far."
    names = {entry.name for entry in state.objects}
    finger, obstacle = sorted(parts, key=lambda name: name in names)
    remedy = "Choose another height or pitch of the hand."
    if obstacle in names:
        remedy = f"Leave more room beside {part(obstacle)}, or come from another side."
    return f"{part(finger)} would meet {part(obstacle)}. {remedy}"


APPROACHES = (0.09, 0.07, 0.055, 0.045, 0.035)
"""[m] Distances of approach and retreat of the open fingers, tried from the farthest."""


def carry(plan: PlanState, to: ToolTarget, name: str) -> PlanState:
    """Return ``plan`` with the way of the tool to ``to``: vertically, about axis 1, then radially.

    The tool keeps its present orientation up to the last part. An object that is held upright stays
    upright unless ``to`` has another orientation.
    """
    present, hand = plan.target, plan.hand
    start = math.atan2(present.position[1], present.position[0])
    end = math.atan2(to.position[1], to.position[0])
    radius = math.hypot(present.position[0], present.position[1])
    z = float(to.position[2])
    raised = present.moved(present.position * (1, 1, 0) + UP * max(z, present.position[2]))
    turn = hand.way_round(start, end)
    position = np.array((radius * math.cos(end), radius * math.sin(end), raised.position[2]))
    over = hand.turned(raised, position, turn)
    curves: list[Curve] = []
    if (raised.position != present.position).any():
        curves.append(line_between(present, raised))
    if abs(turn) > JOIN_TOLERANCE:
        curves.append(arc_between(np.zeros(3), UP, turn, 0.0, raised, over))
    if max(over.apart(to)) > JOIN_TOLERANCE:
        curves.append(line_between(over, to))
    return plan.lead(curves, name) if curves else plan
