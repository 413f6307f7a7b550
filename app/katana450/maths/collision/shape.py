"""Convex shapes for collision checks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.collision.engine import Geometry, Placement
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen

HALF_SPACE_RADIUS = 1e6
"""Radius [m] of the ball that stands for a half-space when balls are compared. Within a metre of
its pole the error is less than a micrometre.
"""

PLANE = b"half-space"
"""The mark of every half-space."""

FLAT = 1e-6
"""Points that deviate less than this [m] from a plane have no volume."""


@dataclass(frozen=True, eq=False)
class CollisionShape:
    """A convex body in a frame of its own.

    Attributes:
        geometry: the geometry that is measured, about ``middle``.
        centre, radius: a ball (3,), scalar [m] that contains the body.
        low, high: corners (3,) of a box along the axes that contains the body [m].
        mark: bytes that identify the shape; other shapes have other marks.
    """

    geometry: Geometry
    centre: FloatArray
    radius: float
    low: FloatArray
    high: FloatArray
    mark: bytes

    @property
    def middle(self) -> FloatArray:
        """The place (3,) of the geometry [m]: a half-space is about a point of its plane."""
        return np.zeros(3) if self.mark == PLANE else self.centre


def placement(*placed: tuple[CollisionShape, FloatArray]) -> Placement:
    """Return the geometries of shapes, each at its pose (4, 4) [m]."""
    return Placement(
        tuple(shape.geometry for shape, _ in placed),
        np.array([T[:3, :3] @ shape.middle + T[:3, 3] for shape, T in placed]),
        np.array([T[:3, :3].ravel() for _, T in placed]),
    )


def hull(points: npt.ArrayLike) -> CollisionShape:
    """Return the convex hull of ``points`` (n, 3) [m]; raise InputError if they lie in a plane."""
    points = np.asarray(points, dtype=np.float64)
    corners = finite_array(points, (len(points), 3), "The points of a hull")
    # Each once, in order, as from `np.unique`, which imports `numpy.ma` at each start.
    corners = corners[np.lexsort(corners.T[::-1])]
    corners = corners[(np.diff(corners, axis=0, prepend=np.nan) != 0.0).any(axis=1)]
    spread = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)
    if len(corners) < 4 or spread[-1] < FLAT * np.sqrt(len(corners)):
        raise InputError(f"The hull has no volume: its {len(corners)} points lie in one plane.")
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre = 0.5 * (low + high)
    radius = float(np.linalg.norm(corners - centre, axis=1).max())
    # About its middle, because the geometry has single precision.
    geometry = Geometry("hull", points=frozen(corners - centre))
    mark = corners.tobytes()
    return CollisionShape(geometry, frozen(centre), radius, frozen(low), frozen(high), mark)


def box(size: npt.ArrayLike) -> CollisionShape:
    """Return a box of ``size`` (3,) [m] about its middle."""
    size = _lengths(size, 3, "The size of a box")
    half, mark = frozen(0.5 * size), b"box" + size.tobytes()
    return _round_middle("box", half, float(np.linalg.norm(half)), mark)


def cylinder(radius: float, length: float) -> CollisionShape:
    """Return an upright cylinder about its middle; lengths in m."""
    _lengths((radius, length), 2, "Radius and length of a cylinder")
    half = frozen((radius, radius, 0.5 * length))
    mark, reach = b"cylinder" + half.tobytes(), float(np.hypot(radius, 0.5 * length))
    return _round_middle("cylinder", half, reach, mark, (radius, 0.5 * length, 0.0))


def sphere(radius: float) -> CollisionShape:
    """Return a ball about its middle; radius in m."""
    _lengths((radius,), 1, "The radius of a sphere")
    half = frozen((radius, radius, radius))
    return _round_middle("sphere", half, radius, b"sphere" + half.tobytes())


def _round_middle(
    kind: str,
    half: FloatArray,
    radius: float,
    mark: bytes,
    size: tuple[float, float, float] | None = None,
) -> CollisionShape:
    """Return a shape about its middle; ``half`` (3,) of the size of its box [m].

    ``size`` is that of the geometry; None if it is ``half``.
    """
    geometry = Geometry(kind, tuple(half.tolist()) if size is None else size)
    return CollisionShape(geometry, frozen(np.zeros(3)), radius, -half, half, mark)


def half_space() -> CollisionShape:
    """Return the half-space z <= 0."""
    far = np.full(3, HALF_SPACE_RADIUS)
    low, high = frozen(-far), frozen(far * (1.0, 1.0, 0.0))
    centre = frozen((0.0, 0.0, -HALF_SPACE_RADIUS))
    return CollisionShape(Geometry("half-space"), centre, HALF_SPACE_RADIUS, low, high, PLANE)


def _lengths(value: npt.ArrayLike, count: int, name: str) -> FloatArray:
    lengths = finite_array(value, (count,), name)
    if (lengths <= 0.0).any():
        raise InputError(f"{name} must be above 0, not {lengths.tolist()}.")
    return lengths
