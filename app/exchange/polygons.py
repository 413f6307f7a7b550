"""Polygons in space cut into triangles: fans of convex ones, ears of the others.

Source of the ears: G. H. Meisters, "Polygons have ears", Amer. Math. Monthly 82 (1975).
"""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray, IntArray

MOST_CORNERS = 2000
"""Of a concave polygon; the effort grows as their square. Larger ones become fans."""


def cut(vertices: FloatArray, corners: IntArray, sizes: IntArray) -> tuple[IntArray, IntArray]:
    """Triangles (m, 3) as places in `corners`, and (m,) the polygon each is of.

    vertices: (n, 3) finite. corners: (k,) indices of them, polygon after polygon. sizes: (p,)
    corners each. A polygon of k corners gives k - 2 triangles, in its own sense of turning; one
    that crosses itself gives as many, somehow.
    """
    starts = np.cumsum(sizes) - sizes
    triangles, owners = [np.zeros((0, 3), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for size in np.unique(sizes[sizes >= 3]).tolist():
        polygons = np.flatnonzero(sizes == size)
        places = starts[polygons][:, None] + np.arange(size)
        fan = np.column_stack((np.zeros(size - 2), np.arange(1, size - 1), np.arange(2, size)))
        local = np.broadcast_to(fan.astype(np.int64), (len(polygons), size - 2, 3)).copy()
        if 3 < size <= MOST_CORNERS:
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
    left = list(range(len(flat)))
    found: list[tuple[int, int, int]] = []
    at = missed = 0
    while len(left) > 3:
        at %= len(left)
        a, b, c = left[at - 1], left[at], left[(at + 1) % len(left)]
        # When nothing is an ear the polygon crosses itself, and any corner will do.
        if missed >= len(left) or _is_ear(flat, left, a, b, c):
            found.append((a, b, c))
            del left[at]
            missed = 0
            # A corner farther on, so that long rows of ears do not end in one point.
            at += 1
        else:
            missed += 1
            at += 1
    return np.array([*found, tuple(left)], dtype=np.int64)


def _is_ear(flat: FloatArray, left: list[int], a: int, b: int, c: int) -> bool:
    ends = flat[[a, b, c]]
    if _turn(ends[0], ends[1], ends[2:])[0] <= 0.0:
        return False
    others = flat[left]
    others = others[(others[:, None] != ends).any(axis=2).all(axis=1)]
    inside = (
        (_turn(ends[0], ends[1], others) >= 0.0)
        & (_turn(ends[1], ends[2], others) >= 0.0)
        & (_turn(ends[2], ends[0], others) >= 0.0)
    )
    return not inside.any()


def _turn(a: FloatArray, b: FloatArray, points: FloatArray) -> FloatArray:
    """(k,) twice the area a, b, p for each point p of (k, 2): positive to the left of a, b."""
    (ax, ay), (bx, by) = a, b
    return np.asarray((bx - ax) * (points[:, 1] - ay) - (by - ay) * (points[:, 0] - ax))
