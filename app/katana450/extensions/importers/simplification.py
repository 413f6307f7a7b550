"""Coarser surfaces of large meshes, for drawing.

Source: J. Rossignac, P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes",
in: Modeling in Computer Graphics (1993), clustering of vertices in a grid.
"""

from __future__ import annotations

import numpy as np

from katana450.extensions.importers.surface import MeshSurface
from katana450.maths.geometry.arrays import FloatArray, IntArray

MAX_CELLS = 1 << 20
"""Maximum number of cells along a side, so that the numbers of a cell fit into 64 bits."""

ENOUGH = 0.75
"""[1] Fraction of the maximum number of triangles with which no finer grid is tried."""

FINER_GRIDS = 2
"""Maximum number of finer grids that are tried after the first one that is coarse enough."""


def coarser(surface: MeshSurface, maximum: int) -> tuple[MeshSurface, float]:
    """Return a surface of at most ``maximum`` triangles, and how far a vertex was moved at most.

    Vertices in the same cell of a grid become their mean. Triangles whose corners become the same,
    and repeated triangles, are left out. The result has the same extent along each axis.
    ``surface`` is not empty and has no equal vertices.
    """
    vertices, faces = surface.vertices, surface.faces
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    edges = np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1)
    fine = float((high - low).max()) / MAX_CELLS
    cell = max(0.5 * float(np.median(edges)), fine)
    found: tuple[IntArray, FloatArray, IntArray] | None = None
    tries, growth = FINER_GRIDS, 1.1
    while found is None or tries:
        cluster, means = _clustered(vertices, low, cell)
        kept = _distinct(cluster[faces], len(means))
        if len(kept) <= maximum:
            found, coarse = (cluster, means, kept), cell
            if len(kept) > ENOUGH * maximum:
                break
        else:
            fine = cell
        if found is None:
            # The number of triangles of a surface falls with the square of the size of a cell. It
            # falls later if there are many small triangles beside large ones.
            cell *= max(float(np.sqrt(len(kept) / maximum)), growth)
            growth **= 2
        else:
            cell = float(np.sqrt(fine * coarse)) if fine * 8.0 > coarse else coarse / 2.0
            tries -= 1
    cluster, means, kept = found
    near, far = means.min(axis=0), means.max(axis=0)
    means = low + (means - near) * ((high - low) / np.where(far > near, far - near, 1.0))
    moved = float(np.linalg.norm(vertices - means[cluster], axis=1).max())
    colours = None if surface.colours is None else surface.colours[kept]
    return MeshSurface(means, cluster[faces[kept]], colours).tidy(), moved


def _clustered(vertices: FloatArray, low: FloatArray, cell: float) -> tuple[IntArray, FloatArray]:
    """Return the cluster (n,) of each vertex, and the mean (k, 3) of each cluster."""
    x, y, z = np.floor((vertices - low) / cell).astype(np.int64).T
    side = MAX_CELLS + 1
    _, cluster = np.unique((x * side + y) * side + z, return_inverse=True)
    count = np.bincount(cluster)
    sums = [np.bincount(cluster, weights=column) for column in vertices.T]
    return cluster.astype(np.int64), np.column_stack(sums) / count[:, None]


def _distinct(faces: IntArray, count: int) -> IntArray:
    """Return the numbers of the faces that have three corners and do not repeat another one."""
    a, b, c = np.sort(faces, axis=1).T
    whole = np.flatnonzero((a != b) & (b != c))
    a, b, c = a[whole], b[whole], c[whole]
    order = np.lexsort((c, a * count + b))
    repeated = np.zeros(len(order), dtype=bool)
    repeated[1:] = (np.diff(a[order]) == 0) & (np.diff(b[order]) == 0) & (np.diff(c[order]) == 0)
    return np.sort(whole[order[~repeated]])
