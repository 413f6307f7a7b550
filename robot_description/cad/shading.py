"""Vertex normals: smooth over fillets, sharp over creases, flat on plane faces."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

CREASE = math.radians(47.0)
"""Faces that meet at a larger angle have separate normals; a 45 degree chamfer looks rounded."""
PAINT_CREASE = math.radians(100.0)
"""The same for paint: an edge of a fraction of a millimetre needs no separate normals."""
COPLANAR = math.radians(0.5)
"""Faces that meet at a smaller angle count as one plane."""
NORMAL_DIGITS = 4
"""Corners of one vertex are merged if their normals agree to this many decimals."""


def weld(
    positions: NDArray[np.float64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return single-precision ``positions`` (n, 3) without duplicates, and their triangles.

    Triangles that single precision collapses to a line are removed together with their twins, so a
    closed surface stays closed.
    """
    unique, inverse = np.unique(positions.astype(np.float32), axis=0, return_inverse=True)
    faces = inverse.reshape(-1)[triangles]
    a, b, c = faces.T
    return unique, faces[(a != b) & (b != c) & (c != a)]


def _patches(triangles: NDArray[np.int64], flat: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return for each triangle the lowest number in its connected coplanar patch."""
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1)
    one, other = order[1:][same] // 3, order[:-1][same] // 3
    level = (flat[one] * flat[other]).sum(axis=1) > math.cos(COPLANAR)
    one, other = one[level], other[level]
    patch = np.arange(len(triangles))
    while True:
        lowest = patch.copy()
        np.minimum.at(lowest, one, patch[other])
        np.minimum.at(lowest, other, patch[one])
        lowest = lowest[lowest]
        if np.array_equal(lowest, patch):
            return patch
        patch = lowest


def _angles(corner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the angles (m, 3) of triangles with the corners (m, 3, 3)."""
    ahead = np.roll(corner, -1, axis=1) - corner
    back = np.roll(corner, 1, axis=1) - corner
    dot = (ahead * back).sum(axis=2)
    cross = np.cross(ahead, back)
    angles: NDArray[np.float64] = np.arctan2(np.sqrt((cross * cross).sum(axis=2)), dot)
    return angles


def shade(
    positions: NDArray[np.float32], triangles: NDArray[np.int64], crease: float = CREASE
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Return vertices, unit normals and triangles; vertices are split where the surface creases.

    ``crease`` is the minimum angle [rad] of a crease.

    A corner's normal is a weighted sum of the normals of faces around its vertex, for all faces
    within the crease angle of its own face. The weight is the corner's angle times the area of the
    whole plane patch of the face. So a large flat face stays flat beside the facets of a fillet,
    and the triangulation of a patch is invisible.
    """
    corner = positions[triangles].astype(np.float64)
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.sqrt((area * area).sum(axis=1))
    flat = area / np.maximum(size, 1e-30)[:, None]
    patch = _patches(triangles, flat)
    weight = (_angles(corner) * np.bincount(patch, weights=size)[patch][:, None]).reshape(-1)

    vertex = triangles.reshape(-1)
    face = np.repeat(np.arange(len(triangles)), 3)
    order = np.argsort(vertex, kind="stable")
    degree = np.bincount(vertex, minlength=len(positions))
    first = np.concatenate(([0], np.cumsum(degree)[:-1]))

    # `mine` and `other` list all pairs of corners with a common vertex.
    meets = degree[vertex]
    mine = np.repeat(np.arange(len(vertex)), meets)
    offset = np.arange(len(mine)) - np.repeat(np.cumsum(meets) - meets, meets)
    other = order[first[vertex[mine]] + offset]
    near = (flat[face[mine]] * flat[face[other]]).sum(axis=1) >= math.cos(crease)
    sliver = size[face[mine]] < 1e-14
    kept = near | sliver
    normal = np.column_stack(
        [
            np.bincount(
                mine[kept],
                weights=flat[face[other[kept]], k] * weight[other[kept]],
                minlength=len(vertex),
            )
            for k in range(3)
        ]
    )
    length = np.sqrt((normal * normal).sum(axis=1))
    normal = np.where((length > 0.0)[:, None], normal / np.maximum(length, 1e-30)[:, None], 0.0)
    normal[length == 0.0] = (0.0, 0.0, 1.0)

    key = np.column_stack((vertex, np.round(normal * 10**NORMAL_DIGITS).astype(np.int64)))
    unique, index, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return (
        positions[unique[:, 0]],
        np.round(normal[index], 5).astype(np.float32),
        inverse.reshape(-1, 3),
    )
