"""Division of a concave shape into convex bodies that together contain its surface.

The triangles are divided by planes across the axes, each time by the plane that reduces the volume
of the hulls most. A triangle belongs to one side whole, and each body is a hull of all its
triangles. So no point of the surface is left out, as approximate decompositions do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.arm.robot.visual import GEOMETRY_FILES, Visual
from katana450.extensions.convex_body import convex_body, hull_faces
from katana450.maths.geometry.arrays import FloatArray

MAX_PIECES = 8
"""Maximum number of bodies of one shape."""

MIN_GAIN_FRACTION, MIN_GAIN = 0.03, 1e-6
"""Minimum volume that a division saves, as a fraction [1] of the hull of the whole, and in m^3."""

PLACES = np.linspace(0.125, 0.875, 7)
"""Places [1] of the planes that are tried, from end to end of a piece."""

SAMPLED = 1500
"""Number of triangles of a piece that are used to choose its plane; its body contains all."""

FLAT = 1e-6
"""[m] Points that deviate less from a plane have no volume."""


class _Split(NamedTuple):
    gain: float
    one: npt.NDArray[np.int64]
    other: npt.NDArray[np.int64]


class _Mesh:
    """Vertices (n, 3) [m] without duplicates, and triangles (m, 3) of their indices."""

    def __init__(self, vertices: FloatArray, faces: npt.NDArray[np.int64]) -> None:
        self._vertices = vertices
        self._faces = faces
        self.middles = vertices[faces].mean(axis=1)

    def points(self, numbers: npt.NDArray[np.int64]) -> FloatArray:
        """Return the vertices (k, 3) of some triangles."""
        return self._vertices[np.unique(self._faces[numbers])]


def pieces(shape: Visual) -> Sequence[FloatArray]:
    """Return the corners (k, 3) [m] of the convex bodies that stand for ``shape``.

    Raises InputError for a mesh without points or size.
    """

    def divided() -> list[FloatArray]:
        mesh = shape.mesh
        return divided_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))

    if shape.primitive is not None:
        return [convex_body(shape.mesh.vertices).corners]
    return shape.kept(divided, list[FloatArray], files=GEOMETRY_FILES)


def divided_mesh(vertices: FloatArray, faces: npt.NDArray[np.int64]) -> list[FloatArray]:
    """Return the corners (k, 3) of at most MAX_PIECES convex bodies round a mesh.

    vertices: (n, 3) [m]. faces: (m, 3) indices. Raises InputError for points all in one place.
    """
    if not len(faces):
        return [convex_body(vertices).corners]
    # Files in STL repeat each vertex in every triangle.
    merged, numbers = np.unique(vertices, axis=0, return_inverse=True)
    mesh = _Mesh(merged, numbers.reshape(-1)[faces])
    whole = np.arange(len(faces))
    least = max(MIN_GAIN, MIN_GAIN_FRACTION * _volume(mesh.points(whole)))
    splits = [_best_split(mesh, whole)]
    parts = [whole]
    while len(parts) < MAX_PIECES:
        best = int(np.argmax([split.gain for split in splits]))
        if splits[best].gain < least:
            break
        halves = splits[best].one, splits[best].other
        parts[best : best + 1] = halves
        splits[best : best + 1] = [_best_split(mesh, half) for half in halves]
    return [convex_body(mesh.points(part)).corners for part in parts]


def _best_split(mesh: _Mesh, numbers: npt.NDArray[np.int64]) -> _Split:
    """Return the division of the triangles ``numbers`` that saves most volume."""
    sample = numbers[:: max(1, len(numbers) // SAMPLED)]
    middles, sampled = mesh.middles[numbers], mesh.middles[sample]
    volume = _volume(mesh.points(sample))
    low, high = middles.min(axis=0), middles.max(axis=0)
    best, place = 0.0, None
    for axis in range(3):
        for cut in (low[axis] + PLACES * (high[axis] - low[axis])).tolist():
            side = sampled[:, axis] < cut
            if side.all() or not side.any():
                continue
            gain = volume - sum(_volume(mesh.points(sample[half])) for half in (side, ~side))
            if gain > best:
                best, place = gain, (axis, cut)
    if place is None:
        return _Split(0.0, numbers, numbers[:0])
    side = middles[:, place[0]] < place[1]
    return _Split(best, numbers[side], numbers[~side])


def _volume(corners: FloatArray) -> float:
    """Return the volume [m^3] of the hull of ``corners`` (n, 3), 0 if they lie in a plane."""
    centred = corners - corners.mean(axis=0)
    spread = np.sqrt(max(float(np.linalg.eigvalsh(centred.T @ centred)[0]), 0.0))
    if len(corners) < 4 or spread < FLAT * np.sqrt(len(corners)):
        return 0.0
    _, heights, areas = hull_faces(centred)
    return float(heights @ areas) / 3.0
