"""Binary STL files, one closed solid per link, for programs that read no GLB; metres."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from manifold3d import Manifold

from robot_description.cad.build import MILLIMETRE, Built, parts
from robot_description.cad.part import Part
from robot_description.cad.shading import weld

STL = Path(__file__).resolve().parent.parent / "stl"
COARSER = 0.1
"""Details smaller than this are left out; mm."""

DIGITS = 4
"""Decimals of a mm in the file. Readers that join corners by distance find the same corners."""

_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("attribute", "<u2")])


def solid_of(part: Part) -> Manifold:
    """Return all of ``part`` as one solid, mm."""
    whole = Manifold()
    for _, body in part.bodies():
        whole = whole + body
    return whole.simplify(COARSER)


def stl_bytes(name: str, solid: Manifold) -> tuple[bytes, int]:
    """Return the STL file of ``solid`` (mm) in metres, and its number of triangles."""
    mesh = solid.to_mesh64()
    points = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3].round(DIGITS) * MILLIMETRE
    positions, triangles = weld(points, np.asarray(mesh.tri_verts, dtype=np.int64))
    corner = positions[triangles].astype(np.float64)
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.sqrt((area * area).sum(axis=1))
    rows = np.zeros(len(triangles), dtype=_TRIANGLE)
    rows["normal"] = area / np.maximum(length, 1e-30)[:, None]
    rows["corner"] = corner
    header = f"{name}, metres".encode().ljust(80)
    return header + struct.pack("<I", len(rows)) + rows.tobytes(), len(rows)


def build_stl(folder: Path = STL) -> Iterator[Built]:
    """Write the STL file of every link into ``folder``, and yield each when it is written."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in parts():
        data, triangles = stl_bytes(part.link, solid_of(part))
        path = folder / f"{part.link}.stl"
        path.write_bytes(data)
        yield Built(path, 1, triangles, len(data))
