"""Distances by coal."""

from __future__ import annotations

from typing import Any

import coal
import numpy as np

from katana450.maths.collision.contact import Witness
from katana450.maths.geometry.arrays import FloatArray, frozen

SIGNED = coal.DistanceRequest()
"""A request that also measures the depth of overlapping bodies, as a negative distance."""

# Of 12,742 distances of the arm, 98 are off by 1 to 99 um with coal's default of 1e-6. With this
# value none is off by more than 8 nm, in the same time.
SIGNED.gjk_tolerance = 1e-8


MAX_NEIGHBOURS = 255
"""Maximum number of edges at a corner of a hull of coal."""


class CoalEngine:
    """The engine on platforms with coal wheels."""

    def hull(self, corners: FloatArray) -> Any:
        """Return the convex hull of ``corners`` (n, 3) [m]."""
        try:
            return coal.Convex.convexHull(_listed(corners), False, "")
        except RuntimeError:
            # A corner has more than MAX_NEIGHBOURS.
            return coal.Convex.convexHull(_listed(_with_few_neighbours(corners)), False, "")

    def box(self, size: FloatArray) -> Any:
        """Return a box of ``size`` (3,) [m] about its middle."""
        return coal.Box(*size.tolist())

    def cylinder(self, radius: float, length: float) -> Any:
        """Return a cylinder along z about its middle [m]."""
        return coal.Cylinder(radius, length)

    def sphere(self, radius: float) -> Any:
        """Return a sphere about its middle [m]."""
        return coal.Sphere(radius)

    def half_space(self) -> Any:
        """Return the half-space z <= 0."""
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)

    def transform(self, T: FloatArray) -> Any:
        """Return the pose ``T`` (4, 4) [m] as a transform of coal."""
        return coal.Transform3s(T[:3, :3], T[:3, 3])

    def distance(self, one: Any, T_one: Any, other: Any, T_other: Any) -> float:
        """Return the distance between two geometries [m]; a negative value is their depth."""
        found: float = coal.distance(one, T_one, other, T_other, SIGNED, coal.DistanceResult())
        return found

    def witness(self, one: Any, T_one: Any, other: Any, T_other: Any) -> Witness:
        """Return the nearest points of two geometries."""
        result = coal.DistanceResult()
        coal.distance(one, T_one, other, T_other, SIGNED, result)
        points = frozen((result.getNearestPoint1(), result.getNearestPoint2()))
        return Witness(float(result.min_distance), points, frozen(result.normal))

    def triangles(self, points: FloatArray) -> FloatArray:
        """Return the corners (m, 3, 3) of the triangles of the hull of ``points`` (n, 3)."""
        try:
            convex = coal.Convex.convexHull(_listed(points), True, "Qt")
        except RuntimeError:
            return _triangles(points)
        corners = np.array([convex.point(i) for i in range(convex.num_points)])
        faces = [convex.polygons(i) for i in range(convex.num_polygons)]
        return np.asarray(corners[np.array([[face[0], face[1], face[2]] for face in faces])])


def _listed(points: FloatArray) -> Any:
    listed = coal.StdVec_Vec3s()
    listed.extend(list(points))
    return listed


def _triangles(points: FloatArray) -> FloatArray:
    """Return the corners (m, 3, 3) of the triangles of any hull, which coal cannot make."""
    # Such hulls are rare, and the library takes a quarter of a second to load.
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).simplices])


def _with_few_neighbours(corners: FloatArray) -> FloatArray:
    """Return at most MAX_NEIGHBOURS points (k, 3) [m] whose hull contains ``corners`` (n, 3) [m].

    They are farthest in directions that are spread evenly on a sphere, and then scaled up about
    their middle.
    """
    height = np.linspace(1.0, -1.0, MAX_NEIGHBOURS)
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(MAX_NEIGHBOURS)
    round_axis = np.sqrt(1.0 - height**2)
    directions = np.stack((round_axis * np.cos(turn), round_axis * np.sin(turn), height), axis=1)
    middle = corners.mean(axis=0)
    around = corners - middle
    few = around[np.unique((around @ directions.T).argmax(axis=0))]
    a, b, c = _triangles(few).transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    heights = np.einsum("ij,ij->i", normals, a)
    # By the height, which is negative where the normal points inwards.
    reach = (around @ (normals / heights[:, None]).T).max()
    return np.asarray(few * float(reach) + middle)
