"""Text of Wavefront OBJ files and their materials (MTL), for programs that do not read glTF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from katana450.arm.robot.surfaces import Material, VisualMesh
from katana450.extensions.export.rows import distinct_rows
from katana450.maths.geometry.arrays import FloatArray, IntArray

DIGITS = 5
"""Decimal places of a coordinate [m]: a hundredth of a millimetre."""

NORMAL_DIGITS = 3
"""Decimal places of a normal."""

LIBRARY = "materials.mtl"
"""Name of the MTL file with the materials, in the folder of the OBJ files."""

MAX_SPECULAR_EXPONENT = 250.0
"""Specular exponent (`Ns`) of a surface with roughness 0; MTL allows up to 1000."""


def obj_text(shapes: Sequence[VisualMesh], material: str | None) -> str:
    """Return the text of an OBJ file with ``shapes`` [m] as one object.

    ``material``: name of its material in `LIBRARY`; None for no material.
    """
    points, point_index = distinct_rows([shape.vertices for shape in shapes], DIGITS)
    normals, normal_index = distinct_rows([shape.normals for shape in shapes], NORMAL_DIGITS)
    starts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
    faces = np.concatenate(
        [shape.faces + start for shape, start in zip(shapes, starts, strict=False)]
    )
    lines = [] if material is None else [f"mtllib {LIBRARY}", f"usemtl {material}"]
    lines += _rows("v", points, DIGITS)
    lines += _rows("vn", normals, NORMAL_DIGITS)
    lines += _faces(point_index[faces] + 1, normal_index[faces] + 1)
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
    kept = (a != b) & (b != c) & (c != a)
    return [
        f"f {i}//{u} {j}//{v} {k}//{w}"
        for (i, j, k), (u, v, w) in zip(points[kept].tolist(), normals[kept].tolist(), strict=True)
    ]
