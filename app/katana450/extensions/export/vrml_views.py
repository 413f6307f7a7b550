"""The viewpoints of an exported world: each is filled by the robot in the exported pose."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from katana450.arm.robot.initial_camera import FIELD_OF_VIEW, VIEW_DIRECTION, InitialCamera
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

MARGIN = 1.06
"""Ratio of the picture's size to that of the robot in it."""


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


def fitted(points: FloatArray, direction: FloatArray) -> InitialCamera:
    """Return the nearest camera along ``direction`` (3,) whose square picture has all ``points``.

    ``points``: (n, 3) [m] in the root's frame.
    """
    R = looking(direction)
    seen = points @ R
    tangent = math.tan(FIELD_OF_VIEW / 2.0) / MARGIN
    # A point at depth z (towards the camera) is in the picture if |x - eye_x| is at most
    # (eye_z - z) tan: two bounds for each of x and y, which meet at the nearest camera.
    right = (seen[:, :2] + seen[:, 2:] * tangent).max(axis=0)
    left = (seen[:, :2] - seen[:, 2:] * tangent).min(axis=0)
    middle = (right + left) / 2.0
    depth = float(np.max(right - left)) / 2.0 / tangent + 1e-3
    return InitialCamera(R @ (*middle, depth), R @ (*middle, float(seen[:, 2].mean())))


def looking(direction: FloatArray) -> FloatArray:
    """Return the rotation (3, 3) in the root of a camera along ``direction`` (3,).

    Its x points right, y up and -z ahead. Seen from above, y of the root is up.
    """
    back = -direction / np.linalg.norm(direction)
    right = np.cross((0.0, 0.0, 1.0), back)
    size = float(np.linalg.norm(right))
    right = right / size if size > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.column_stack((right, np.cross(back, right), back))
