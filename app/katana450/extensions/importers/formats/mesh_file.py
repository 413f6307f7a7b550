"""The mesh of a scene object, read from its file."""

from __future__ import annotations

import hashlib

import numpy as np

from katana450.arm.control.state.solid import Solid
from katana450.arm.robot.object_meshes import Mesh
from katana450.errors import InputError
from katana450.extensions.convex_body import ConvexBody
from katana450.extensions.importers.formats.shape_file import (
    UNITS,
    Format,
    ShapeFile,
    Up,
)
from katana450.extensions.importers.guarded_reading import read_shape_guarded

HULL_DISTANCE_TO_REPORT = 2e-3
"""[m] Distance of a hull from its mesh from which it is reported."""

HULL_VOLUME_RATIO_TO_REPORT = 1.2
"""[1] Ratio of the volumes of hull and mesh from which it is reported."""


def read_mesh(
    data: bytes,
    file: str,
    unit: str | None = None,
    up: Up | None = None,
    *,
    main: str = "",
) -> Mesh:
    """Return the mesh in a file, read in a subprocess within some seconds.

    Args:
        data: content of the file.
        file: name of the file.
        unit: a key of UNITS; None to guess it.
        up: axis that points up, as in `read_shape`.
        main: path of the shape file in a .zip, as in `read_shape`.

    Raises InputError with the defect of the file.
    """
    format = Format.of(file)
    if unit is not None and unit not in UNITS:
        raise InputError(f"The unit must be one of {', '.join(UNITS)}, not {unit!r}.")
    metres = None if unit is None else UNITS[unit]
    shape, body = read_shape_guarded(data, format, file, metres, up, main=main)
    sign = next(sign for sign, length in UNITS.items() if length == shape.unit)
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    foot = np.array((*(0.5 * (low + high)[:2]), low[2]))
    settings = f"{shape.format.value} {sign} {'' if up is None else up.value}\n".encode()
    key = hashlib.sha256(settings + shape.file).hexdigest()[:32]
    x, y, z = (high - low).tolist()
    return Mesh(
        shape.file,
        shape.format.value,
        sign,
        None if up is None else up.value,
        shape.name,
        shape.vertices - foot,
        shape.faces,
        shape.colours,
        Solid(key, (x, y, z), body.corners - foot),
        f"{shape.text} {_counted(shape, body)}",
        shape.scale,
    )


def _counted(shape: ShapeFile, body: ConvexBody) -> str:
    """Return a sentence on the convex hull that stands for the mesh in collision checks."""
    notes = ["Collision checks use its convex hull"]
    if body.thickened:
        notes.append("it is flat, so the hull is made slightly thick")
    if body.off > HULL_DISTANCE_TO_REPORT:
        notes.append(f"the hull is simplified and reaches up to {1e3 * body.off:.1f} mm beyond it")
    volume = _volume(shape)
    if volume is not None and body.volume > HULL_VOLUME_RATIO_TO_REPORT * volume:
        notes.append(f"its hollows count as filled: {body.volume / volume:.1f} times its volume")
    return "; ".join(notes) + "."


def _volume(shape: ShapeFile) -> float | None:
    """Return the volume [m^3] of a closed surface by tetrahedra over its faces; None if open."""
    edges = np.sort(shape.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    # One number for both ends of an edge, because sorting pairs takes over ten times as long.
    numbers = edges[:, 0].astype(np.int64) * len(shape.vertices) + edges[:, 1]
    counts = np.unique(numbers, return_counts=True)[1]
    if not (counts == 2).all():
        return None
    a, b, c = (shape.vertices - shape.vertices.mean(axis=0))[shape.faces].transpose(1, 0, 2)
    volume = abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
    return volume if volume > 0.0 else None
