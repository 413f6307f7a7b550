"""Approach of the hand to an object, and transport of the object that it holds."""

from __future__ import annotations

import math

import numpy as np

from katana450.extensions.programs.building.plan_state import PlanState
from katana450.extensions.programs.planning.approach import UP
from katana450.extensions.programs.planning.curves import Curve, arc_between, line_between
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.plan import JOIN_TOLERANCE

APPROACHES = (0.09, 0.07, 0.055, 0.045, 0.035)
"""[m] Distances of approach and retreat of the open fingers, tried from the farthest."""


def carry(plan: PlanState, to: ToolTarget, name: str) -> PlanState:
    """Return ``plan`` with the way of the tool to ``to``: vertically, about axis 1, then radially.

    The tool keeps its present orientation up to the last part. An object that is held upright stays
    upright unless ``to`` has another orientation.
    """
    at, hand = plan.target, plan.hand
    here = math.atan2(at.position[1], at.position[0])
    there = math.atan2(to.position[1], to.position[0])
    radius = math.hypot(at.position[0], at.position[1])
    z = float(to.position[2])
    raised = at.moved(at.position * (1, 1, 0) + UP * max(z, at.position[2]))
    turn = hand.way_round(here, there)
    beside = np.array((radius * math.cos(there), radius * math.sin(there), raised.position[2]))
    over = hand.turned(raised, beside, turn)
    curves: list[Curve] = []
    if (raised.position != at.position).any():
        curves.append(line_between(at, raised))
    if abs(turn) > JOIN_TOLERANCE:
        curves.append(arc_between(np.zeros(3), UP, turn, 0.0, raised, over))
    if max(over.apart(to)) > JOIN_TOLERANCE:
        curves.append(line_between(over, to))
    return plan.lead(curves, name) if curves else plan
