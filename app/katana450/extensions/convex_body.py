"""A convex body with few corners round many points, which stands for a mesh in collision checks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from katana450.arm.control.state.solid import MAX_CORNERS
from katana450.errors import InputError
from katana450.maths.collision.engine import hull_triangles
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen

MIN_THICKNESS_FRACTION = 0.005
"""Minimum thickness [1] relative to the length; a flatter body is thickened to have an inside."""

EXACT = 1e-6
"""Tolerance [1] relative to the length: points that are outside by less count as inside."""

SEARCHED_CORNERS = 400
"""Number of corners of the true hull at which the search ends."""

BLOCK = 50_000
"""Number of values per block, which fit a processor's cache."""


@dataclass(frozen=True, eq=False)
class ConvexBody:
    """A convex body that contains all points of a mesh.

    Attributes:
        corners: corners (k, 3) [m], k <= MAX_CORNERS.
        off: maximum distance by which it exceeds the planes of the true convex hull [m].
        thickened: True if the points had no volume.
        volume: volume of the true hull [m^3].
    """

    corners: FloatArray
    off: float
    thickened: bool
    volume: float

    def scaled(self, factor: float) -> ConvexBody:
        """Return it ``factor`` times as large."""
        corners = frozen(self.corners * factor)
        return replace(self, corners=corners, off=self.off * factor, volume=self.volume * factor**3)


def convex_body(points: npt.ArrayLike) -> ConvexBody:
    """Return a convex body round ``points`` (n, 3) [m], which must not all be in one place.

    The result is the convex hull itself if that has few corners. Otherwise it is one of two bodies,
    the one that exceeds the hull less. The first is a box along the axes, from which planes of the
    hull cut off what stands out farthest; it suits shapes with edges. The second is the hull of a
    few of its corners, scaled up about a middle; it suits round shapes.

    Raises InputError for no points, and for points all in one place.
    """
    points = np.asarray(points, dtype=np.float64)
    points = finite_array(points, (len(points), 3), "The points of a mesh")
    if not len(points):
        raise InputError("The mesh has no points.")
    low, high = points.min(axis=0), points.max(axis=0)
    length = float((high - low).max())
    if length <= 0.0:
        raise InputError("The mesh has no size: all its points are in one place.")
    middle = 0.5 * (low + high)
    # Centred and scaled to length 1, so that one tolerance fits all.
    scaled, thickened = _with_volume((points - middle) / length)
    low, high = scaled.min(axis=0), scaled.max(axis=0)
    corners, planes = _hull(scaled)
    volume = _volume(corners)
    off = 0.0
    if len(corners) > MAX_CORNERS:
        inside = corners.mean(axis=0)
        cut = _cut(planes, low, high, inside)
        grown = _grown(scaled, corners, planes, inside)
        corners, off = min(cut, grown, key=lambda solution: solution[1])
    return ConvexBody(
        frozen(corners * length + middle), off * length, thickened, volume * length**3
    )


def _with_volume(points: FloatArray) -> tuple[FloatArray, bool]:
    """Return the points, doubled across flat directions, and True if there were any."""
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    flat = [axis for axis in axes.T if np.ptp(points @ axis) < MIN_THICKNESS_FRACTION]
    for axis in flat:
        points = np.concatenate(
            (
                points - 0.5 * MIN_THICKNESS_FRACTION * axis,
                points + 0.5 * MIN_THICKNESS_FRACTION * axis,
            )
        )
    return points, bool(flat)


def _hull(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the hull's corners (k, 3) and its planes (m, 4), which contain all ``points``.

    A plane is n (3,) and the h of n @ x <= h. Of a very round body not all corners are found; its
    planes lie where they touch the farthest point.
    """
    corners = points[np.unique(hull_triangles(points, SEARCHED_CORNERS))]
    normals, heights, _ = hull_faces(corners)
    planes = np.column_stack((normals, np.maximum(_reach(points, normals), heights)))
    return corners[_used(corners)], _distinct(planes)


def _reach(points: FloatArray, directions: FloatArray) -> FloatArray:
    """Return how far ``points`` reach along each direction (m, 3), (m,)."""
    step = max(1, BLOCK // len(directions))
    blocks = (points[start : start + step] for start in range(0, len(points), step))
    # A maximum over rows of consecutive numbers takes a fifth of the time of one along them.
    return np.asarray(np.max([(block @ directions.T).max(axis=0) for block in blocks], axis=0))


def hull_faces(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return outward normals (m, 3), heights (m,) and areas (m,) of the faces of a small hull."""
    a, b, c = points[hull_triangles(points)].transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    sizes = np.linalg.norm(normals, axis=1)
    real = sizes > EXACT**2
    normals = normals[real] / sizes[real, None]
    heights = np.einsum("ij,ij->i", normals, a[real])
    inwards = heights < normals @ points.mean(axis=0)
    normals[inwards] *= -1.0
    heights[inwards] *= -1.0
    return normals, heights, 0.5 * sizes[real]


def _used(points: FloatArray) -> npt.NDArray[np.bool_]:
    """Return True for corners of the hull, and False for points in a face or an edge of it."""
    normals, heights, _ = hull_faces(points)
    touching = np.abs(points @ normals.T - heights) <= EXACT
    used = np.zeros(len(points), dtype=bool)
    for number, row in enumerate(touching):
        used[number] = len(_distinct(np.column_stack((normals[row], heights[row])))) > 2
    return used


def _distinct(planes: FloatArray) -> FloatArray:
    """Return the planes without duplicates, to rounding."""
    _, first = np.unique(np.round(planes, 5) + 0.0, axis=0, return_index=True)
    return planes[np.sort(first)]


def _volume(corners: FloatArray) -> float:
    """Return the volume of the hull of ``corners``: pyramids from the origin onto its faces."""
    _, heights, areas = hull_faces(corners)
    return float(heights @ areas) / 3.0


def _cut(
    planes: FloatArray, low: FloatArray, high: FloatArray, inside: FloatArray
) -> tuple[FloatArray, float]:
    """Return corners (k, 3) round the body of ``planes``, and by how much they exceed these.

    ``low``, ``high`` (3,) are its ends along the axes, ``inside`` (3,) is a point in it.
    """
    bounds = np.concatenate(
        (np.column_stack((np.eye(3), high)), np.column_stack((-np.eye(3), -low)))
    )
    corners = _corners(bounds, inside)
    while True:
        over = corners @ planes[:, :3].T - planes[:, 3]
        worst = int(over.max(axis=0).argmax())
        off = float(over.max())
        if off <= EXACT:
            return corners, off
        candidates = np.concatenate((bounds, planes[worst : worst + 1]))
        cut = _corners(candidates, inside)
        if len(cut) > MAX_CORNERS:
            return corners, off
        bounds, corners = candidates, cut


def _grown(
    points: FloatArray, corners: FloatArray, planes: FloatArray, inside: FloatArray
) -> tuple[FloatArray, float]:
    """Return a body like ``_cut``: the hull of MAX_CORNERS ``corners``, scaled up to hold all."""
    few = corners[np.unique(hull_triangles(corners, MAX_CORNERS))] - inside
    normals, heights, _ = hull_faces(few)
    reach = _reach(points - inside, normals)
    grown = few * float((reach / heights).max()) + inside
    return grown, float((grown @ planes[:, :3].T - planes[:, 3]).max())


def _corners(planes: FloatArray, inside: FloatArray) -> FloatArray:
    """Return the corners of the body under all ``planes``.

    They follow from the hull of the dual points n / h (Preparata and Shamos, Computational
    Geometry, 1985, ch. 7).
    """
    normals, heights = planes[:, :3], planes[:, 3] - planes[:, :3] @ inside
    dual, far, _ = hull_faces(normals / heights[:, None])
    corners = dual / far[:, None] + inside
    _, first = np.unique(np.round(corners, 6) + 0.0, axis=0, return_index=True)
    return np.asarray(corners[np.sort(first)])
