"""Measures of surfaces, independent of the readers."""

from __future__ import annotations

from collections import Counter

import numpy as np
import numpy.typing as npt

from katana450.extensions.importers.formats.shape_file import ShapeFile

Numbers = npt.NDArray[np.float64]


def volume(shape: ShapeFile) -> float:
    """Return the volume [m^3] by the divergence theorem; positive if the faces look outward."""
    a, b, c = np.moveaxis(shape.vertices[shape.faces], 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def sides(shape: ShapeFile) -> list[float]:
    """Return the extent along x, y and z [mm]."""
    return [float(side) for side in np.round(np.ptp(shape.vertices, axis=0) * 1e3, 3)]


def is_closed(shape: ShapeFile) -> bool:
    """Return whether each edge belongs to one face in each direction."""
    edges = Counter((int(face[i]), int(face[i - 2])) for face in shape.faces for i in range(3))
    return all(edges[b, a] == count for (a, b), count in edges.items())


def triangles(vertices: Numbers, faces: npt.NDArray[np.int64], digits: int) -> Counter[object]:
    """Return each triangle by its rounded corners, the smallest corner first."""
    counts: Counter[object] = Counter()
    # Adding zero turns -0 into 0.
    for corners in (np.round(vertices[faces], digits) + 0.0).tolist():
        least = corners.index(min(corners))
        counts[str(corners[least:] + corners[:least])] += 1
    return counts
