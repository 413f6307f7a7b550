"""Rotations of the joints of the Katana450 as fields of the VRML world."""

from __future__ import annotations

THERE = {"axis_1": 0.4, "axis_2": -1.0, "axis_3": 1.3, "axis_4": 0.3, "axis_5": -0.5}
AXES = {"axis_1": (0, 0, 1), "axis_5": (1, 0, 0)}
"""Axes of the joints that do not turn about y."""


def rotation(joint: str, angle: float) -> list[float]:
    return [*AXES.get(joint, (0, 1, 0)), angle]
