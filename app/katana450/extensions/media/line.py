"""A line in space as a thin tube."""

from __future__ import annotations

import math

import numpy as np

from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.extensions.media.scene import Item, unit
from katana450.maths.geometry.arrays import FloatArray

SIDES = 8
"""Number of sides of a tube."""

MIN_POINT_DISTANCE = 1e-5
"""[m] Minimum distance of distinct points."""


def tube(name: str, points: FloatArray, radius: float, rgb: tuple[int, int, int]) -> Item | None:
    """Return a tube along ``points`` (n, 3) [m] in the base frame; None if all are equal.

    ``rgb`` is the colour, 0 to 255.
    """
    far = np.linalg.norm(np.diff(points, axis=0), axis=1) > MIN_POINT_DISTANCE
    points = points[np.concatenate(([True], far))]
    if len(points) < 2:
        return None
    ahead = unit(np.gradient(points, axis=0)).astype(float)
    aside = np.empty_like(points)
    last = np.eye(3)[int(np.abs(ahead[0]).argmin())]
    for number, direction in enumerate(ahead):
        # The vector aside is projected from point to point, so that the tube does not twist.
        last = last - (last @ direction) * direction
        last /= float(np.linalg.norm(last))
        aside[number] = last
    upright = np.cross(ahead, aside)
    turn = np.arange(SIDES) * (math.tau / SIDES)
    out = np.cos(turn)[:, None] * aside[:, None] + np.sin(turn)[:, None] * upright[:, None]
    a = np.arange(SIDES)
    b = (a + 1) % SIDES
    quad = np.concatenate(
        (np.stack((a, b, b + SIDES), axis=1), np.stack((a, b + SIDES, a + SIDES), axis=1))
    )
    faces = (quad + SIDES * np.arange(len(points) - 1)[:, None, None]).reshape(-1, 3)
    corners = (points[:, None] + radius * out).reshape(-1, 3)
    colour = rgb[0] / 255.0, rgb[1] / 255.0, rgb[2] / 255.0
    return Item(
        name, VisualMesh(Material(name, colour), corners, out.reshape(-1, 3), faces), np.eye(4)
    )
