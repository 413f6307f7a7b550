"""Distances by FCL; each is checked by a lower bound and recomputed where FCL ends early.

FCL (python-fcl) has wheels for Windows, where coal has none. Some of its distances are wrong by
millimetres, so every distance is checked: along the direction between the nearest points, the
supports of both bodies bound the true distance from below.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import fcl
import numpy as np
from scipy.spatial import ConvexHull

from katana450.maths.collision.contact import Witness
from katana450.maths.collision.nearest_points import Support, deepest, nearest_points, overlap
from katana450.maths.geometry.arrays import FloatArray, frozen

SCALE = 1e3
"""Lengths are passed to FCL in millimetres [1/m]: it ends its search at 1e-6 of its unit."""

CERTAIN = 1e-7
"""Maximum difference [m] between an accepted distance of FCL and its bound."""

NEAR = 1e-6
"""Nearest points closer than this [m] give no direction."""

SIGNED = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)

AXES = np.concatenate((np.eye(3), -np.eye(3)))


@dataclass(frozen=True, eq=False)
class Geometry:
    """A convex body of FCL, and its support mapping.

    Attributes:
        shape: FCL's shape, in millimetres; None for the half-space, which FCL does not measure.
        support: the support mapping in the frame of the body [m].
        normals: unit directions (m, 3) along which the body may be left.
    """

    shape: Any
    support: Support
    normals: FloatArray


class ScaledPose(NamedTuple):
    """Rotation (3, 3), translation (3,) [m], and both as a transform of FCL."""

    R: FloatArray
    t: FloatArray
    scaled: Any


class FclEngine:
    """The engine where coal has no wheel."""

    def hull(self, corners: FloatArray) -> Geometry:
        """Return the convex hull of ``corners`` (n, 3) [m]."""
        found = ConvexHull(corners, qhull_options="Qt")
        used, faces = np.unique(_oriented(found), return_inverse=True)
        points = np.ascontiguousarray(corners[used])
        faces = faces.reshape(-1, 3)
        listed = np.column_stack((np.full(len(faces), 3), faces)).ravel()
        shape = fcl.Convex(SCALE * points, len(faces), listed)
        return Geometry(shape, lambda n: points[(points @ n).argmax()], found.equations[:, :3])

    def box(self, size: FloatArray) -> Geometry:
        """Return a box of ``size`` (3,) [m] about its middle."""
        half = 0.5 * size
        return Geometry(fcl.Box(*(SCALE * size)), lambda n: np.copysign(half, n), AXES)

    def cylinder(self, radius: float, length: float) -> Geometry:
        """Return a cylinder along z about its middle [m]."""

        def support(n: FloatArray) -> FloatArray:
            across = max(float(np.hypot(n[0], n[1])), 1e-300)
            x, y = radius * n[:2] / across
            return np.array([x, y, np.copysign(0.5 * length, n[2])])

        return Geometry(fcl.Cylinder(SCALE * radius, SCALE * length), support, AXES)

    def sphere(self, radius: float) -> Geometry:
        """Return a sphere about its middle [m]."""
        # FCL measures no depth of its own Sphere in a cylinder.
        size = np.full(3, SCALE * radius)
        return Geometry(fcl.Ellipsoid(*size), lambda n: radius * n / np.linalg.norm(n), AXES)

    def half_space(self) -> Geometry:
        """Return the half-space z <= 0."""
        return Geometry(None, lambda _: np.zeros(3), AXES[2:3])

    def transform(self, T: FloatArray) -> ScaledPose:
        """Return the pose ``T`` (4, 4) [m]."""
        R, t = T[:3, :3], T[:3, 3]
        return ScaledPose(R, t, fcl.Transform(R, SCALE * t))

    def distance(
        self, one: Geometry, T_one: ScaledPose, other: Geometry, T_other: ScaledPose
    ) -> float:
        """Return the distance between two geometries [m]; a negative value is their depth."""
        return self.witness(one, T_one, other, T_other).distance

    def witness(
        self, one: Geometry, T_one: ScaledPose, other: Geometry, T_other: ScaledPose
    ) -> Witness:
        """Return the nearest points of two geometries."""
        if one.shape is None:
            return _over(T_one, _placed(other, T_other))
        if other.shape is None:
            found = _over(T_other, _placed(one, T_one))
            return Witness(found.distance, frozen(found.points[::-1]), frozen(-found.normal))
        first, second = _placed(one, T_one), _placed(other, T_other)
        result = fcl.DistanceResult()
        placed = (
            fcl.CollisionObject(one.shape, T_one.scaled),
            fcl.CollisionObject(other.shape, T_other.scaled),
        )
        try:
            distance = fcl.distance(*placed, SIGNED, result) / SCALE
        except RuntimeError:
            # FCL raises this when its search for a depth meets a degenerate triangle.
            return _searched(first, second, _directions(one, T_one, other, T_other))
        points = np.array(result.nearest_points) / SCALE
        gap = points[1] - points[0]
        length = float(np.linalg.norm(gap))
        if length > NEAR and abs(length - abs(distance)) <= CERTAIN:
            normal = gap / np.copysign(length, distance)
            if abs(distance + overlap(first, second, normal)) <= CERTAIN:
                return Witness(distance, frozen(points), frozen(normal))
        return _searched(first, second, _directions(one, T_one, other, T_other))

    def triangles(self, points: FloatArray) -> FloatArray:
        """Return the corners (m, 3, 3) of the triangles of the hull of ``points`` (n, 3)."""
        return np.asarray(points[ConvexHull(points, qhull_options="Qt").simplices])


def _oriented(hull: ConvexHull) -> Any:
    """Return the corners (m, 3) of each triangle, counterclockwise seen from outside."""
    faces = hull.simplices.copy()
    a, b, c = hull.points[faces].transpose(1, 0, 2)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards, ::-1]
    return faces


def _placed(geometry: Geometry, pose: ScaledPose) -> Support:
    """Return the support mapping of a geometry at a pose, in the base frame."""
    R, t, support = pose.R, pose.t, geometry.support
    return lambda n: R @ support(n @ R) + t


def _over(ground: ScaledPose, body: Support) -> Witness:
    """Return the nearest points of a half-space and a body."""
    up = ground.R[:, 2]
    lowest = body(-up)
    height = float(up @ (lowest - ground.t))
    return Witness(height, frozen((lowest - height * up, lowest)), frozen(up))


def _directions(
    one: Geometry, T_one: ScaledPose, other: Geometry, T_other: ScaledPose
) -> Iterator[FloatArray]:
    """Yield unit directions that may lead the second body out of the first."""
    between = T_other.t - T_one.t
    length = float(np.linalg.norm(between))
    yield between / length if length > NEAR else AXES[2]
    yield from one.normals @ T_one.R.T
    yield from -(other.normals @ T_other.R.T)


def _searched(one: Support, other: Support, directions: Iterator[FloatArray]) -> Witness:
    """Return the nearest points without FCL. The first of ``directions`` starts the search."""
    start = next(directions)
    points = nearest_points(one, other, start)
    if points is None:
        return deepest(one, other, (start, *directions))
    gap = points[1] - points[0]
    distance = float(np.linalg.norm(gap))
    return Witness(distance, frozen(points), frozen(gap / distance))
