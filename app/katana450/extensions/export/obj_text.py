"""Meshes as text: rounded and distinct rows, and Wavefront OBJ files with their materials (MTL).

OBJ is for programs that do not read glTF.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from katana450.arm.robot.surfaces import Material, VisualMesh
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


LIBRARY = "materials.mtl"
"""Name of the MTL file with the materials, in the folder of the OBJ files."""

MAX_SPECULAR_EXPONENT = 250.0
"""Specular exponent (`Ns`) of a surface with roughness 0; MTL allows up to 1000."""


def obj_text(shapes: Sequence[VisualMesh], material: str | None) -> str:
    """Return the text of an OBJ file with ``shapes`` [m] as one object.

    ``material``: name of its material in `LIBRARY`; None for no material.
    """
    surface = indexed(shapes)
    lines = [] if material is None else [f"mtllib {LIBRARY}", f"usemtl {material}"]
    lines += _rows("v", surface.points, DIGITS)
    lines += _rows("vn", surface.normals, NORMAL_DIGITS)
    lines += _faces(surface.faces + 1, surface.normal_faces + 1)
    return "\n".join((*lines, ""))


def mtl_text(materials: Mapping[str, Material]) -> str:
    """Return the text of `LIBRARY`. ``materials``: by the names that the OBJ files use."""
    return "\n".join(
        f"newmtl {name}\n"
        f"Kd {' '.join(f'{part:.4f}' for part in material.colour)}\n"
        f"Ks {' '.join([f'{material.gleam:.4f}'] * 3)}\n"
        f"Ns {MAX_SPECULAR_EXPONENT * (1.0 - material.rough):.2f}\n"
        for name, material in materials.items()
    )


def _rows(keyword: str, rows: FloatArray, digits: int) -> list[str]:
    return [f"{keyword} {x:.{digits}f} {y:.{digits}f} {z:.{digits}f}" for x, y, z in rows.tolist()]


def _faces(points: IntArray, normals: IntArray) -> list[str]:
    """Return a line for each triangle, except those with two equal corners after rounding.

    ``points`` and ``normals`` (n, 3): indices of the corners and of their normals, from 1.
    """
    a, b, c = points.T
    whole = (a != b) & (b != c) & (c != a)
    return [
        f"f {i}//{u} {j}//{v} {k}//{w}"
        for (i, j, k), (u, v, w) in zip(
            points[whole].tolist(), normals[whole].tolist(), strict=True
        )
    ]
