"""Triangulation of polygons in space: fans for convex polygons, ear clipping for the others.

Source of ear clipping: G. H. Meisters, "Polygons have ears", Amer. Math. Monthly 82 (1975).
"""

from __future__ import annotations

from collections import deque

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, IntArray


def cut(vertices: FloatArray, corners: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Return triangles (m, 3) as places in ``corners``, and the polygon (m,) of each.

    Args:
        vertices: (n, 3), finite.
        corners: (k,) indices of vertices, polygon after polygon.
        sizes: (p,) number of corners of each polygon.

    A polygon of k corners gives k - 2 triangles with its own orientation. A polygon that crosses
    itself gives as many, of arbitrary shape. The effort for a concave polygon grows with its number
    of corners times the number that lies within the extent of an ear.
    """
    starts = np.cumsum(sizes) - sizes
    triangles, owners = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for size in np.unique(sizes[sizes >= 3]).tolist():
        polygons = np.flatnonzero(sizes == size)
        places = starts[polygons][:, None] + np.arange(size)
        fan = np.column_stack((np.zeros(size - 2), np.arange(1, size - 1), np.arange(2, size)))
        local = np.broadcast_to(fan.astype(np.int64), (len(polygons), size - 2, 3)).copy()
        if size > 3:
            points = vertices[corners[places]]
            for number in np.flatnonzero(_concave(points)).tolist():
                local[number] = _ears(points[number])
        triangles.append(np.take_along_axis(places[:, None, :], local, axis=2).reshape(-1, 3))
        owners.append(np.repeat(polygons, size - 2))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order], owner[order]


def _normals(points: FloatArray) -> FloatArray:
    """Return normals (p, 3) of polygons (p, k, 3), of any length, by Newell's sum."""
    ahead = np.roll(points, -1, axis=1)
    return np.asarray(np.cross(points, ahead).sum(axis=1))


def _concave(points: FloatArray) -> IntArray:
    """Return for each polygon of (p, k, 3) whether it has a concave corner, (p,)."""
    points = points - points[:, :1]
    before, ahead = np.roll(points, 1, axis=1), np.roll(points, -1, axis=1)
    turns = np.einsum("pkc,pc->pk", np.cross(points - before, ahead - points), _normals(points))
    scale = np.abs(turns).max(axis=1, keepdims=True)
    return np.asarray((turns < -1e-9 * scale).any(axis=1))


def _ears(points: FloatArray) -> IntArray:
    """Return the triangles (k - 2, 3) of one polygon (k, 3), as numbers of its corners."""
    points = points - points[0]
    normal = _normals(points[None])[0]
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(points, axis, axis=1)
    if (normal[axis] < 0.0) != (axis == 1):
        flat = flat[:, ::-1]
    count = len(flat)
    before, ahead = [*range(-1, count - 1)], [*range(1, count), 0]
    before[0] = count - 1
    rest = _RemainingCorners(flat)
    is_ear = [rest.is_ear(before[b], b, ahead[b]) for b in range(count)]
    ears = deque(b for b in range(count) if is_ear[b])
    found: list[tuple[int, int, int]] = []
    b = 0
    while len(found) < count - 2:
        while ears and not is_ear[ears[0]]:
            ears.popleft()
        # Without an ear the polygon crosses itself; then any corner is taken.
        b = ears.popleft() if ears else ahead[b]
        a, c = before[b], ahead[b]
        found.append((a, b, c))
        rest.left[b] = is_ear[b] = False
        ahead[a], before[c] = c, a
        # Only the two neighbours can become an ear by this, or cease to be one.
        for corner in (a, c):
            was, is_ear[corner] = (
                is_ear[corner],
                rest.is_ear(before[corner], corner, ahead[corner]),
            )
            if is_ear[corner] and not was:
                ears.append(corner)
    return np.array(found, dtype=np.int64)


class _RemainingCorners:
    """The remaining corners (k, 2) of a polygon, sorted along its longer axis."""

    def __init__(self, flat: FloatArray) -> None:
        self._flat = flat
        self.left = np.ones(len(flat), dtype=bool)
        self._axis = int(np.ptp(flat, axis=0).argmax())
        self._order = np.argsort(flat[:, self._axis], kind="stable")
        self._along = flat[self._order, self._axis]

    def is_ear(self, a: int, b: int, c: int) -> bool:
        """Return whether corner b is convex, and no remaining corner lies in its triangle."""
        ends = self._flat[[a, b, c]]
        if _turn(ends[0], ends[1], ends[2:])[0] <= 0.0:
            return False
        span = ends[:, self._axis]
        first = self._along.searchsorted(span.min(), "left")
        last = self._along.searchsorted(span.max(), "right")
        near = self._order[first:last]
        others = self._flat[near[self.left[near]]]
        inside = (
            (_turn(ends[0], ends[1], others) >= 0.0)
            & (_turn(ends[1], ends[2], others) >= 0.0)
            & (_turn(ends[2], ends[0], others) >= 0.0)
        )
        # Corners equal to its own do not count, such as those that a bridge to a hole duplicates.
        return bool((others[inside][:, None] == ends).all(axis=2).any(axis=1).all())


def _turn(a: FloatArray, b: FloatArray, points: FloatArray) -> FloatArray:
    """Return twice the signed area of a, b, p for each point p of (k, 2); positive left of a, b."""
    (ax, ay), (bx, by) = a, b
    return np.asarray((bx - ax) * (points[:, 1] - ay) - (by - ay) * (points[:, 0] - ax))
