"""Rounded and distinct rows of coordinates for text formats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from katana450.arm.robot.surfaces import VisualMesh
from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, IntArray

DIGITS = 5
"""Decimal places of a coordinate [m]: a hundredth of a millimetre."""

NORMAL_DIGITS = 3
"""Decimal places of a normal."""


class IndexedSurface(NamedTuple):
    """Triangles with distinct rows.

    Attributes:
        points, normals: (n, 3) [m] and (k, 3), each row once.
        faces, normal_faces: (m, 3) indices of the points and of the normals of each corner.
    """

    points: FloatArray
    normals: FloatArray
    faces: IntArray
    normal_faces: IntArray


def indexed(shapes: Sequence[VisualMesh]) -> IndexedSurface:
    """Return ``shapes`` as one surface with rounded rows. Raises InputError for infinite ones."""
    points, point_index = _distinct([shape.vertices for shape in shapes], DIGITS)
    normals, normal_index = _distinct([shape.normals for shape in shapes], NORMAL_DIGITS)
    starts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    faces = np.concatenate(
        [shape.faces + start for shape, start in zip(shapes, starts, strict=False)]
    )
    return IndexedSurface(points, normals, point_index[faces], normal_index[faces])


def _distinct(parts: Sequence[FloatArray], digits: int) -> tuple[FloatArray, IntArray]:
    """Return the distinct rounded rows of ``parts``, and for every row its index in them."""
    rows = np.round(np.concatenate(parts), digits) + 0.0
    if not np.isfinite(rows).all():
        raise InputError("A shape has coordinates that are not finite numbers.")
    distinct, index = np.unique(rows, axis=0, return_inverse=True)
    return distinct, index.reshape(-1).astype(np.int64)
