"""A few corners round many points: what a mesh counts as where contacts are looked for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.collision.engine import engine
from katana450.maths.geometry.arrays import FloatArray, finite_array, frozen

MAX_CORNERS = 64
"""Corners: distances to so few are measured as quickly as to any link's."""

MIN_THICKNESS_FRACTION = 0.005
"""[1] Of its length: what is flatter counts as so thick, that it has an inside."""

EXACT = 1e-6
"""[1] Of its length: points that are out by less are in."""

SEARCHED_CORNERS = 200
"""Corners of the true hull that are looked for; of more of them the planes are, that hold all."""

BLOCK = 200_000
"""Numbers worked on at once: what a processor's cache holds."""


@dataclass(frozen=True, eq=False)
class ConvexBody:
    """A convex body that holds all points.

    Attributes:
        corners: (k, 3) [m], k <= MOST.
        off: at most how far it reaches over the planes of the true convex hull [m].
        thickened: whether the points had no volume to speak of.
        volume: of the true hull [m^3].
    """

    corners: FloatArray
    off: float
    thickened: bool
    volume: float


def convex_body(points: npt.ArrayLike) -> ConvexBody:
    """Round ``points`` (n, 3) [m], some apart. Raises InputError for points all in one place.

    The convex hull itself where that has few corners. Else what reaches over it less of two: a box
    along the axes, from which planes of the hull cut off what stands out farthest, which suits what
    has edges; and the hull of a few of the points, grown about a middle, which suits what is round.
    """
    points = np.asarray(points, dtype=np.float64)
    points = finite_array(points, (len(points), 3), "The points of a mesh")
    if not len(points):
        raise InputError("A mesh without points makes no body.")
    low, high = points.min(axis=0), points.max(axis=0)
    length = float((high - low).max())
    if length <= 0.0:
        raise InputError("A mesh all in one place makes no body.")
    middle = 0.5 * (low + high)
    # About the origin and of length 1, so that one tolerance does for all.
    scaled, thickened = _with_volume((points - middle) / length)
    low, high = scaled.min(axis=0), scaled.max(axis=0)
    corners, planes, spanning = _hull(scaled)
    volume = _volume(corners)
    off = 0.0
    if len(corners) > MAX_CORNERS:
        inside = corners.mean(axis=0)
        cut = _cut(planes, low, high, inside)
        grown = _grown(spanning, corners, planes, inside)
        corners, off = min(cut, grown, key=lambda found: found[1])
    return ConvexBody(
        frozen(corners * length + middle), off * length, thickened, volume * length**3
    )


def _with_volume(points: FloatArray) -> tuple[FloatArray, bool]:
    """The same, drawn apart across where they are flat."""
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


def _hull(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Corners (k, 3) of the hull, its planes (m, 4), and the points (l, 3) that span what they do.

    A plane is n (3,) and the h of n @ x <= h. The search begins with four corners and adds what is
    farthest over each face (Barber et al., The Quickhull algorithm for convex hulls, 1996), of all
    faces at once. Points inside what is found are not looked at again.
    """
    corners = points[_simplex(points)]
    while True:
        normals, heights, _ = _faces(corners)
        farthest, over, outside = _over(points, normals, heights)
        points = points[outside]
        out = over > heights + EXACT
        if not out.any() or len(corners) > SEARCHED_CORNERS:
            break
        corners = np.unique(np.concatenate((corners, farthest[out])), axis=0)
    # What is left out of a very round body is out by a hair; the planes hold it even so.
    planes = np.column_stack((normals, np.maximum(over, heights)))
    used = _used(corners)
    return corners[used], _distinct(planes), np.concatenate((corners, points))


def _over(
    points: FloatArray, normals: FloatArray, heights: FloatArray
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Return the farthest point (m, 3) over each face, its height, and which points are outside.

    Points within EXACT of a face count as inside. One pass over the points, in blocks that stay
    in the processor's cache.
    """
    best = np.full(len(normals), -np.inf)
    farthest = np.zeros((len(normals), 3))
    outside = np.zeros(len(points), dtype=bool)
    limit = (heights + EXACT)[:, None]
    step = max(1, BLOCK // len(normals))
    for at in range(0, len(points), step):
        block = points[at : at + step]
        along = normals @ block.T
        number = along.argmax(axis=1)
        maximum = along[np.arange(len(normals)), number]
        better = maximum > best
        best[better], farthest[better] = maximum[better], block[number[better]]
        # Only where a face has something over it any point of the block can be outside.
        rows = maximum > limit[:, 0]
        if rows.any():
            outside[at : at + step] = (along[rows] > limit[rows]).any(axis=0)
    return farthest, best, outside


def _simplex(points: FloatArray) -> list[int]:
    """Four that are in no plane: the first far from the middle, each next far from those before."""
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())]
    left = points - points[chosen[0]]
    for _ in range(3):
        lengths = np.linalg.norm(left, axis=1)
        chosen.append(int(lengths.argmax()))
        along = left[chosen[-1]] / lengths.max()
        left = left - np.outer(left @ along, along)
    return chosen


def _farthest(
    points: FloatArray, directions: FloatArray
) -> tuple[npt.NDArray[np.int64], FloatArray]:
    """Of each direction (m, 3) the point that is farthest along it, and how far."""
    number = np.zeros(len(directions), dtype=np.int64)
    along = np.full(len(directions), -np.inf)
    rows = np.arange(len(directions))
    step = max(1, BLOCK // len(directions))
    for at in range(0, len(points), step):
        heights = directions @ points[at : at + step].T
        best = heights.argmax(axis=1)
        maximum = heights[rows, best]
        better = maximum > along
        number[better], along[better] = at + best[better], maximum[better]
    return number, along


def _faces(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Normals outwards (m, 3), heights (m,) and areas (m,) of the faces of the hull of a few."""
    a, b, c = engine().triangles(points).transpose(1, 0, 2)
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
    """Which are corners of their own hull, and not in a face or an edge of it."""
    normals, heights, _ = _faces(points)
    touching = np.abs(points @ normals.T - heights) <= EXACT
    used = np.zeros(len(points), dtype=bool)
    for number, row in enumerate(touching):
        used[number] = len(_distinct(np.column_stack((normals[row], heights[row])))) > 2
    return used


def _distinct(planes: FloatArray) -> FloatArray:
    """Without those that are the same to rounding."""
    _, first = np.unique(np.round(planes, 5) + 0.0, axis=0, return_index=True)
    return planes[np.sort(first)]


def _volume(corners: FloatArray) -> float:
    """Of their hull: pyramids from the origin onto its faces."""
    _, heights, areas = _faces(corners)
    return float(heights @ areas) / 3.0


def _cut(
    planes: FloatArray, low: FloatArray, high: FloatArray, inside: FloatArray
) -> tuple[FloatArray, float]:
    """Corners (k, 3) round the body of ``planes``, and by how much they are over these.

    low, high: (3,) its ends along the axes. inside: (3,) a point in it.
    """
    kept = np.concatenate((np.column_stack((np.eye(3), high)), np.column_stack((-np.eye(3), -low))))
    corners = _corners(kept, inside)
    while True:
        over = corners @ planes[:, :3].T - planes[:, 3]
        worst = int(over.max(axis=0).argmax())
        off = float(over.max())
        if off <= EXACT:
            return corners, off
        tried = np.concatenate((kept, planes[worst : worst + 1]))
        cut = _corners(tried, inside)
        if len(cut) > MAX_CORNERS:
            return corners, off
        kept, corners = tried, cut


def _grown(
    points: FloatArray, corners: FloatArray, planes: FloatArray, inside: FloatArray
) -> tuple[FloatArray, float]:
    """As ``_cut``: MOST of the ``corners``, always the one that is farthest out, grown over all."""
    chosen = _simplex(corners)
    while len(chosen) < MAX_CORNERS:
        normals, heights, _ = _faces(corners[chosen])
        farthest, over = _farthest(corners, normals)
        new = int(farthest[(over - heights).argmax()])
        if new in chosen:
            break
        chosen.append(new)
    few = corners[chosen] - inside
    normals, heights, _ = _faces(few)
    _, reach = _farthest(points - inside, normals)
    grown = few * float((reach / heights).max()) + inside
    return grown, float((grown @ planes[:, :3].T - planes[:, 3]).max())


def _corners(planes: FloatArray, inside: FloatArray) -> FloatArray:
    """Of what is under all ``planes``, by the hull of the dual points n / h (Preparata and Shamos,
    Computational Geometry, 1985, ch. 7).
    """
    normals, heights = planes[:, :3], planes[:, 3] - planes[:, :3] @ inside
    dual, far, _ = _faces(normals / heights[:, None])
    corners = dual / far[:, None] + inside
    _, first = np.unique(np.round(corners, 6) + 0.0, axis=0, return_index=True)
    return np.asarray(corners[np.sort(first)])
