"""The convex body of an object: how deep a point is inside it, and its volume."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from katana450.arm.control.scene_objects import MAX_OBJECTS, SceneObject, Shape
from katana450.maths.collision.engine import hull_triangles
from katana450.maths.geometry.arrays import FloatArray, frozen

FLAT = 1e-12
"""[m^2] Area of a triangle below which it has no direction."""


@dataclass(frozen=True, eq=False)
class SolidBody:
    """A convex body about its own middle: a part of half-spaces, a cylinder and a ball.

    A point x is inside if n @ x <= h for each plane, if it is nearer to the axis z than the radius
    of the cylinder, and nearer to the middle than that of the ball.

    Attributes:
        normals: (m, 3) outward unit normals n.
        heights: (m,) heights h [m].
        cylinder: radius about z [m]; None without this bound.
        ball: radius about the middle [m]; None without this bound.
        volume: [m^3].
    """

    normals: FloatArray
    heights: FloatArray
    volume: float
    cylinder: float | None = None
    ball: float | None = None

    def depth(self, points: FloatArray) -> FloatArray:
        """Return the distance (n,) of each point (n, 3) inside to the nearest face [m].

        It is negative outside: there it is the distance to the farthest of the planes.
        """
        depth = np.full(len(points), np.inf)
        if len(self.normals):
            depth = (self.heights - points @ self.normals.T).min(axis=1)
        if self.cylinder is not None:
            depth = np.minimum(depth, self.cylinder - np.hypot(points[:, 0], points[:, 1]))
        if self.ball is not None:
            depth = np.minimum(depth, self.ball - np.sqrt(np.einsum("ij,ij->i", points, points)))
        return depth


def body_of(scene_object: SceneObject) -> SolidBody:
    """Return the body of ``scene_object`` about the middle of its collision shape."""
    size = scene_object.extent
    match scene_object.shape:
        case Shape.BOX:
            x, y, z = size
            normals = np.concatenate((np.eye(3), -np.eye(3)))
            return SolidBody(frozen(normals), frozen(0.5 * np.array((*size, *size))), x * y * z)
        case Shape.CYLINDER | Shape.VESSEL:
            radius, height = size
            normals = np.array(((0.0, 0.0, 1.0), (0.0, 0.0, -1.0)))
            volume = np.pi * radius**2 * height
            return SolidBody(frozen(normals), frozen((0.5 * height,) * 2), volume, cylinder=radius)
        case Shape.SPHERE:
            (radius,) = size
            volume = 4.0 / 3.0 * np.pi * radius**3
            return SolidBody(frozen(np.empty((0, 3))), frozen(()), volume, ball=radius)
    assert scene_object.solid is not None
    corners = scene_object.solid.corners.tobytes()
    return _hull(corners, scene_object.scale, 0.5 * scene_object.height)


@lru_cache(maxsize=2 * MAX_OBJECTS)
def _hull(corners: bytes, scale: float, middle: float) -> SolidBody:
    """Return the body of a mesh about its middle, from the triangles of its convex hull."""
    points = scale * np.frombuffer(corners).reshape(-1, 3) - (0.0, 0.0, middle)
    a, b, c = points[hull_triangles(points)].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    sizes = np.linalg.norm(normals, axis=1)
    real = sizes > FLAT
    normals, sizes = normals[real] / sizes[real, None], sizes[real]
    heights = np.einsum("ij,ij->i", normals, a[real])
    inside = points.mean(axis=0)
    inwards = heights < normals @ inside
    normals[inwards] *= -1.0
    heights[inwards] *= -1.0
    volume = float((heights - normals @ inside) @ sizes) / 6.0
    planes = np.round(np.column_stack((normals, heights)), 9) + 0.0
    _, first = np.unique(planes, axis=0, return_index=True)
    return SolidBody(frozen(normals[first]), frozen(heights[first]), volume)
