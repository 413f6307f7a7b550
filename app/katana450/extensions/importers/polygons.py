"""Polygons in space cut into triangles: fans of convex ones, ears of the others.

Source of the ears: G. H. Meisters, "Polygons have ears", Amer. Math. Monthly 82 (1975).
"""

from __future__ import annotations

from collections import deque

import numpy as np

from katana450.maths.geometry.arrays import FloatArray, IntArray


def cut(vertices: FloatArray, corners: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles (m, 3) as places in `corners`, and (m,) the polygon each is of.

    vertices: (n, 3) finite. corners: (k,) indices of them, polygon after polygon. sizes: (p,)
    corners each. A polygon of k corners gives k - 2 triangles, in its own sense of turning; one
    that crosses itself gives as many, somehow. The effort grows with the corners of a concave one
    times those of them that lie as far along it as an ear does.
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
    """(p, 3) by Newell's sum, of polygons (p, k, 3); of any length."""
    ahead = np.roll(points, -1, axis=1)
    return np.asarray(np.cross(points, ahead).sum(axis=1))


def _concave(points: FloatArray) -> IntArray:
    """(p,) whether a corner of the polygons (p, k, 3) turns the other way."""
    points = points - points[:, :1]
    before, ahead = np.roll(points, 1, axis=1), np.roll(points, -1, axis=1)
    turns = np.einsum("pkc,pc->pk", np.cross(points - before, ahead - points), _normals(points))
    scale = np.abs(turns).max(axis=1, keepdims=True)
    return np.asarray((turns < -1e-9 * scale).any(axis=1))


def _ears(points: FloatArray) -> IntArray:
    """(k - 2, 3) corners of one polygon (k, 3)."""
    points = points - points[0]
    normal = _normals(points[None])[0]
    axis = int(np.argmax(np.abs(normal)))
    flat = np.delete(points, axis, axis=1)
    if (normal[axis] < 0.0) != (axis == 1):
        flat = flat[:, ::-1]
    count = len(flat)
    before, ahead = [*range(-1, count - 1)], [*range(1, count), 0]
    before[0] = count - 1
    rest = _Rest(flat)
    is_ear = [rest.is_ear(before[b], b, ahead[b]) for b in range(count)]
    ears = deque(b for b in range(count) if is_ear[b])
    found: list[tuple[int, int, int]] = []
    b = 0
    while len(found) < count - 2:
        while ears and not is_ear[ears[0]]:
            ears.popleft()
        # When nothing is an ear the polygon crosses itself, and any corner will do.
        b = ears.popleft() if ears else ahead[b]
        a, c = before[b], ahead[b]
        found.append((a, b, c))
        rest.left[b] = is_ear[b] = False
        ahead[a], before[c] = c, a
        # Of the others none becomes an ear by this, or ceases to be one.
        for corner in (a, c):
            was, is_ear[corner] = (
                is_ear[corner],
                rest.is_ear(before[corner], corner, ahead[corner]),
            )
            if is_ear[corner] and not was:
                ears.append(corner)
    return np.array(found, dtype=np.int64)


class _Rest:
    """The corners (k, 2) of a polygon that are left, in order along the axis it is longer on."""

    def __init__(self, flat: FloatArray) -> None:
        self._flat = flat
        self.left = np.ones(len(flat), dtype=bool)
        self._axis = int(np.ptp(flat, axis=0).argmax())
        self._order = np.argsort(flat[:, self._axis], kind="stable")
        self._along = flat[self._order, self._axis]

    def is_ear(self, a: int, b: int, c: int) -> bool:
        """Whether the corner b turns left and none of those left is in its triangle."""
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
        # Its own corners do not count, nor those that a bridge to a hole puts there once more.
        return bool((others[inside][:, None] == ends).all(axis=2).any(axis=1).all())


def _turn(a: FloatArray, b: FloatArray, points: FloatArray) -> FloatArray:
    """(k,) twice the area a, b, p for each point p of (k, 2): positive to the left of a, b."""
    (ax, ay), (bx, by) = a, b
    return np.asarray((bx - ax) * (points[:, 1] - ay) - (by - ay) * (points[:, 0] - ax))
