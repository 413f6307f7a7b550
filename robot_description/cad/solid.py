"""Solids from lofted rings: prisms with rounded edges, turned parts, blocks; all in mm."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import manifold3d
import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray

from robot_description.cad.outline import (
    CHAMFER_BELOW,
    Outline,
    circle,
    facets_of,
    filleted,
    inset,
    on_grid,
    rectangle,
    segments_of,
)

Axis = Literal["x", "y", "z"]
Direction = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Point = tuple[float, float, float]
Range = tuple[float, float]

# Target axes of the outline's two coordinates and of the height.
_AXES: dict[Axis, tuple[int, int, int]] = {"x": (1, 2, 0), "y": (0, 2, 1), "z": (0, 1, 2)}
_TURNS: dict[Direction, list[list[int]]] = {
    "+x": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
    "-x": [[0, 0, -1], [-1, 0, 0], [0, 1, 0]],
    "+y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "+z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
}


def loft(rings: Sequence[NDArray[np.float64]]) -> Manifold:
    """Return the solid through ``rings``, each (n, 3), counter-clockwise about the up direction.

    Raises:
        ValueError: the rings do not close to a solid.
    """
    count = len(rings[0])
    here = np.arange(count)
    there = np.roll(here, -1)
    faces: list[NDArray[np.int64]] = []
    for k in range(len(rings) - 1):
        low, high = k * count, (k + 1) * count
        faces.append(np.column_stack((here + low, there + low, there + high)))
        faces.append(np.column_stack((here + low, there + high, here + high)))
    cap = np.asarray(manifold3d.triangulate([rings[0][:, :2]]), dtype=np.int64)
    faces.append(cap[:, ::-1])
    cap = np.asarray(manifold3d.triangulate([rings[-1][:, :2]]), dtype=np.int64)
    faces.append(cap + (len(rings) - 1) * count)
    mesh = manifold3d.Mesh64(
        vert_properties=np.vstack(rings), tri_verts=np.vstack(faces).astype(np.uint64)
    )
    solid = Manifold(mesh)
    if solid.status() != manifold3d.Error.NoError or solid.volume() <= 0.0:
        raise ValueError(f"the loft of {len(rings)} rings is no solid: {solid.status()}")
    return solid


def placed(solid: Manifold, toward: Direction = "+z", at: Point = (0.0, 0.0, 0.0)) -> Manifold:
    """Return ``solid`` with its z axis turned to the direction ``toward`` and its origin moved."""
    turn = np.array(_TURNS[toward], dtype=np.float64)
    return solid.transform(np.column_stack((turn, np.array(at))))


def prism(
    outline: Outline,
    low: float,
    high: float,
    edge: float | Range = 0.0,
    axis: Axis = "z",
) -> Manifold:
    """Return ``outline`` extruded from ``low`` to ``high`` along ``axis`` with rounded edges.

    The outline's coordinates are (y, z) for axis x, (x, z) for y, (x, y) for z. ``edge`` is the
    radius at both ends or at (low, high).
    """
    start, end = (edge, edge) if isinstance(edge, float | int) else edge
    levels: list[tuple[float, float]] = []
    for radius, base, sign in ((start, low, 1.0), (end, high, -1.0)):
        facets = facets_of(radius)
        steps = range(facets + 1) if radius > 0.0 else range(1)
        angles = [math.pi / 2.0 * k / facets for k in steps]
        ends = [
            (base + sign * radius * (1.0 - math.cos(a)), radius * (1.0 - math.sin(a)))
            for a in angles
        ]
        levels += ends if sign > 0.0 else ends[::-1]
    rings = []
    for height, distance in levels:
        flat = inset(outline, distance) if distance > 1e-9 else outline
        rings.append(on_grid(np.column_stack((flat, np.full(len(flat), height)))))
    solid = loft(rings)
    u, v, w = _AXES[axis]
    turn = np.zeros((3, 4))
    turn[u, 0] = turn[v, 1] = turn[w, 2] = 1.0
    return solid.transform(turn)


def lathe(
    profile: Sequence[tuple[float, float, float]],
    toward: Direction = "+z",
    at: Point = (0.0, 0.0, 0.0),
    segments: int = 0,
) -> Manifold:
    """Return the turned part of ``profile``: (height, radius, fillet) from bottom to top, mm."""
    count = segments or segments_of(max(radius for _, radius, _ in profile))
    chain = [(radius, height, fillet) for height, radius, fillet in profile]
    chain = [(0.0, profile[0][0], 0.0), *chain, (0.0, profile[-1][0], 0.0)]
    rings = []
    for radius, height in (point for arc in filleted(chain) for point in arc):
        flat = circle(radius, segments=count)
        rings.append(on_grid(np.column_stack((flat, np.full(count, height)))))
    return placed(loft(rings), toward, at)


def rod(
    diameter: float,
    low: float,
    high: float,
    toward: Direction = "+z",
    at: Point = (0.0, 0.0, 0.0),
    edge: float = 0.0,
    segments: int = 0,
) -> Manifold:
    """Return a cylinder from ``low`` to ``high`` along ``toward``, its rims rounded by ``edge``."""
    radius = diameter / 2.0
    return lathe([(low, radius, edge), (high, radius, edge)], toward, at, segments)


def block(x: Range, y: Range, z: Range, edge: float = 0.0) -> Manifold:
    """Return the box over three ranges with its edges rounded by ``edge``."""
    corner = edge if edge < CHAMFER_BELOW else 1.3 * edge
    return prism(rectangle(x, y, corner), z[0], z[1], edge)


def around(count: int, radius: float, phase: float = 0.0) -> list[tuple[float, float]]:
    """Return ``count`` evenly spaced points on a circle of ``radius`` mm, from ``phase`` on."""
    angles = [phase + 2.0 * math.pi * k / count for k in range(count)]
    return [(radius * math.cos(a), radius * math.sin(a)) for a in angles]


def ball(diameter: float, at: Point, segments: int = 16) -> Manifold:
    """Return a sphere with ``segments`` around its equator."""
    radius, half = diameter / 2.0, segments // 2
    angles = [math.pi * (k / half - 0.5) for k in range(1, half)]
    profile = [(radius * math.sin(a), radius * math.cos(a), 0.0) for a in angles]
    return lathe(profile, "+z", at, segments)


def aimed(solid: Manifold, toward: Point, at: Point = (0.0, 0.0, 0.0)) -> Manifold:
    """Return ``solid`` with its z axis turned along the unit vector ``toward``, then moved."""
    z = np.array(toward)
    side = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = np.cross(side, z)
    x /= math.sqrt(float((x * x).sum()))
    turn = on_grid(np.column_stack((x, np.cross(z, x), z)))
    return solid.transform(np.column_stack((turn, np.array(at))))
