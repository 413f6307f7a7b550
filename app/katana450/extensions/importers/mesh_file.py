"""The mesh of an object, read from its file."""

from __future__ import annotations

import hashlib

import numpy as np

from katana450.arm.control.solid import Solid
from katana450.arm.robot.object_meshes import Mesh
from katana450.errors import InputError
from katana450.extensions.importers.shape_file import (
    UNITS,
    Format,
    ShapeFile,
    Up,
    read_shape_guarded,
)
from katana450.maths.collision.convex_body import ConvexBody

HULL_DISTANCE_TO_REPORT = 2e-3
"""[m] That a hull stands off is worth a word from here on."""

HULL_VOLUME_RATIO_TO_REPORT = 1.2
"""[1] Likewise how many times as large it is."""


def read_mesh(data: bytes, file: str, unit: str | None = None, up: Up | None = None) -> Mesh:
    """The mesh in a file of that name.

    unit: a key of UNITS; None to guess. up: as `read_shape` has it. Reads in a process of its own,
    and takes up to some seconds. Raises InputError with what is wrong.
    """
    format = Format.of(file)
    metres = None if unit is None else unit_of(unit)
    shape, found = read_shape_guarded(data, format, file, metres, up)
    sign = next(sign for sign, length in UNITS.items() if length == shape.unit)
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    foot = np.array((*(0.5 * (low + high)[:2]), low[2]))
    told = f"{format.value} {sign} {'' if up is None else up.value}\n".encode()
    key = hashlib.sha256(told + data).hexdigest()[:32]
    x, y, z = (high - low).tolist()
    return Mesh(
        data,
        format.value,
        sign,
        None if up is None else up.value,
        shape.name,
        shape.vertices - foot,
        shape.faces,
        shape.colours,
        Solid(key, (x, y, z), found.corners - foot),
        f"{shape.text} {_counted(shape, found)}",
    )


def unit_of(sign: str) -> float:
    """[m] Of a unit by its sign. Raises InputError."""
    if sign not in UNITS:
        raise InputError(f"A unit is one of {', '.join(UNITS)}, not {sign!r}.")
    return UNITS[sign]


def _counted(shape: ShapeFile, found: ConvexBody) -> str:
    """What it counts as where contacts are looked for."""
    said = ["Contacts are looked for with its convex hull"]
    if found.thickened:
        said.append("it is flat, and counts as a little thick")
    if found.off > HULL_DISTANCE_TO_REPORT:
        said.append(f"that is simplified, and reaches up to {1e3 * found.off:.1f} mm over it")
    volume = _volume(shape)
    if volume is not None and found.volume > HULL_VOLUME_RATIO_TO_REPORT * volume:
        said.append(f"its hollows count as filled: {found.volume / volume:.1f} times what it is")
    return "; ".join(said) + "."


def _volume(shape: ShapeFile) -> float | None:
    """[m^3] Of a closed surface, by the tetrahedra over its faces; None of another."""
    edges = np.sort(shape.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    counts = np.unique(edges, axis=0, return_counts=True)[1]
    if not (counts == 2).all():
        return None
    a, b, c = (shape.vertices - shape.vertices.mean(axis=0))[shape.faces].transpose(1, 0, 2)
    volume = abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
    return volume if volume > 0.0 else None
