"""Capsules along the drawn sticks of links whose shapes for contacts are missing or unreadable."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from katana450.arm.robot.collision import Pieces
from katana450.arm.robot.link import Link
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.visual import ROD_LENGTH, PrimitiveShape, Visual
from katana450.errors import InputError, RobotDescriptionError
from katana450.maths.collision.shape import hull
from katana450.maths.geometry.arrays import FloatArray, frozen

RADIUS_RATIO, MAX_RADIUS = 0.1, 0.06
"""Radius of a capsule, as a ratio [1] to the longest stick of the robot, and its maximum [m]."""


def drawn(link: Link) -> tuple[Visual, ...]:
    """Return the visuals of ``link`` without the sticks that represent missing ones."""
    return tuple(visual for visual in link.visuals if not visual.is_rod)


def with_estimates(robot: Robot, pieces: Pieces) -> tuple[Robot, frozenset[str]]:
    """Return ``robot`` with shapes for all links that have a stick, and the links of unknown shape.

    What is drawn replaces collision shapes that are missing. ``pieces``: see ``world_of``.
    """
    links, unknown = [], []
    for link in robot.links:
        visuals, collisions = link.visuals, link.collisions
        if robot.collides and link.missing[1]:
            collisions = (*collisions, *drawn(link))
        if _is_unknown(robot, link, collisions, pieces):
            unknown.append(link.name)
            capsules = _capsules(robot, link)
            if robot.collides:
                collisions = (*collisions, *capsules)
            elif capsules:
                visuals = (*drawn(link), *capsules)
        links.append(replace(link, visuals=visuals, collisions=collisions))
    return replace(robot, links=tuple(links)), frozenset(unknown)


def _is_unknown(robot: Robot, link: Link, collisions: Sequence[Visual], pieces: Pieces) -> bool:
    """Return whether shapes of ``link`` for contacts are missing and not drawn, or unreadable."""
    no_visuals, no_collisions = link.missing
    if no_collisions and (no_visuals or not drawn(link)):
        return True
    if no_visuals and not robot.collides:
        return True
    try:
        for shape in collisions if robot.collides else drawn(link):
            for points in pieces(shape):
                hull(points)
    except (InputError, RobotDescriptionError):
        return True
    return False


def _capsules(robot: Robot, link: Link) -> list[Visual]:
    """Return a capsule along each stick from ``link`` to its children.

    It begins inside the stick, so that a link that stands on the table does not reach into it. The
    other end goes round the joint of the child.
    """
    lengths = [float(np.linalg.norm(member.T_parent_link[:3, 3])) for member in robot.links]
    radius = min(RADIUS_RATIO * max(lengths), MAX_RADIUS)
    ends = [child.T_parent_link[:3, 3] for child in robot.children(link)]
    return [
        Visual(frozen(np.eye(4)), frozen(np.ones(3)), None, make=partial(_capsule, end, radius))
        for end in ends
        if np.linalg.norm(end) > ROD_LENGTH
    ]


def _capsule(end: FloatArray, radius: float) -> Any:
    """Return the corners, as a trimesh, of a capsule of ``radius`` round the stick to ``end`` [m].

    end: (3,) in the frame of the link [m].
    """
    mesh = PrimitiveShape("icosphere", {"subdivisions": 1, "radius": radius}).mesh()
    start = min(radius / float(np.linalg.norm(end)), 1.0) * end
    mesh.faces, mesh.vertices = [], np.concatenate((mesh.vertices + start, mesh.vertices + end))
    return mesh
