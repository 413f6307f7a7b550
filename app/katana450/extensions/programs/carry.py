"""Approach of the hand to an object, and transport of the object that it holds."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from katana450.extensions.programs.curve import Curve, Linear, ToolArc, ToolLine
from katana450.extensions.programs.plan_builder import Approach, PlanBuilder
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.planning.plan import JOIN_TOLERANCE

APPROACHES = (0.09, 0.07, 0.055, 0.045, 0.035)
"""[m] Distances of approach and retreat of the open fingers, tried from the farthest."""

UP = frozen((0.0, 0.0, 1.0))


def before(middle: FloatArray, approach: Approach, back: float) -> ToolTarget:
    """Return the tool ``back`` [m] before ``middle`` (3,) [m] in {S}, on its own axis."""
    pitch, roll = approach
    out = np.array((middle[0], middle[1], 0.0)) / math.hypot(middle[0], middle[1])
    along = math.cos(pitch) * out - math.sin(pitch) * UP
    return ToolTarget(middle - back * along, pitch, roll)


def carry(builder: PlanBuilder, to: ToolTarget, name: str) -> None:
    """Move the tool to ``to``: vertically, then about axis 1, then radially.

    The tool keeps its present orientation up to the last part. An object that is held upright stays
    upright unless ``to`` has another orientation.
    """
    at = builder.at
    here = math.atan2(at.position[1], at.position[0])
    there = math.atan2(to.position[1], to.position[0])
    radius = math.hypot(at.position[0], at.position[1])
    z = float(to.position[2])
    raised = replace(at, position=at.position * (1, 1, 0) + UP * max(z, at.position[2]))
    turned = ToolArc(
        raised.position,
        np.zeros(3),
        UP,
        there - here,
        Linear(at.pitch, at.pitch),
        Linear(at.roll, at.roll),
    )
    over = replace(
        raised,
        position=np.array((radius * math.cos(there), radius * math.sin(there), raised.position[2])),
    )
    curves: list[Curve] = []
    if (raised.position != at.position).any():
        curves.append(ToolLine(at, raised))
    if abs(there - here) > JOIN_TOLERANCE:
        curves.append(turned)
    turns = abs(to.pitch - over.pitch), abs(to.roll - over.roll)
    if max(float(np.abs(over.position - to.position).max()), *turns) > JOIN_TOLERANCE:
        curves.append(ToolLine(over, to))
    if curves:
        builder.lead(curves, name)
