"""The viewpoints of an exported world: each is filled by the robot in the exported pose."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from katana450.arm.robot.initial_camera import VIEW_DIRECTION, InitialCamera, fitted
from katana450.arm.robot.robot import Robot
from katana450.maths.geometry.arrays import FloatArray

DIRECTIONS: Mapping[str, tuple[float, float, float]] = {
    "All": VIEW_DIRECTION,
    "Front": (-1.0, 0.0, 0.0),
    "Side": (0.0, 1.0, 0.0),
    "Top": (0.0, 0.0, -1.0),
}
"""Directions of view in the root's frame, by viewpoint. x of the root points ahead."""

TOOL = "Tool"
"""Name of the viewpoint of the links behind the last axis of an arm."""


def views(robot: Robot, values: Mapping[str, float]) -> dict[str, InitialCamera]:
    """Return the cameras of all viewpoints with the joints at ``values`` [rad, m], by name."""
    points: dict[str, FloatArray] = {}
    for link, T in zip(robot.links, robot.frames(values).values(), strict=True):
        if link.shapes:
            vertices = np.concatenate([shape.vertices for shape in link.shapes])
            points[link.name] = vertices @ T[:3, :3].T + T[:3, 3]
    everything = np.concatenate([*points.values(), np.zeros((1, 3))])
    found = {name: fitted(everything, np.array(way)) for name, way in DIRECTIONS.items()}
    if robot.arm is not None:
        last = robot.arm.chain.names[-1]
        behind = [
            points[link.name]
            for link in robot.links
            if link.name in points
            and any(at.joint is not None and at.joint.name == last for at in robot.path_to(link))
        ]
        if behind:
            found[TOOL] = fitted(np.concatenate(behind), np.array(VIEW_DIRECTION))
    return found
