"""3MF by trimesh.

Source: 3MF Consortium, 3MF Core Specification 1.3. The archive is measured before it is unpacked;
trimesh expands no entity and opens no file outside of it.
"""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
from trimesh.exchange.threemf import load_3MF

from katana450.errors import InputError
from katana450.extensions.importers.library_errors import failures_in_words
from katana450.extensions.importers.surface import (
    MAX_COPIES,
    MeshBuilder,
    MeshReading,
    MeshSurface,
    of_polygons,
)

MAX_FILES = 256
"""Files of an archive."""

MODEL = "3d/3dmodel.model"

UNITS = {
    **{"micron": 1e-6, "millimeter": 1e-3, "millimeters": 1e-3, "centimeter": 1e-2},
    **{"inch": 0.0254, "foot": 0.3048, "meter": 1.0},
}
"""[m] Units of the specification, and trimesh's word where a file tells none."""


def read_3mf(data: bytes, name: str, maximum: int) -> MeshReading:
    """Return the triangles of all items of the build. Raises InputError if there are none.

    most: [bytes] that the files of the archive have together.
    """
    _check_archive(data, name, maximum)
    builder = MeshBuilder(name)
    with failures_in_words(name):
        found = load_3MF(io.BytesIO(data))  # type: ignore[no-untyped-call]
        surfaces = {key: _surface(mesh, name) for key, mesh in found["geometry"].items()}
        for number, item in enumerate(found["graph"]):
            if number >= MAX_COPIES:
                raise InputError(f"{name} shows more than {MAX_COPIES} objects.")
            if item["geometry"] in surfaces:
                builder.add(surfaces[item["geometry"]].moved(np.asarray(item["matrix"])))
        unit = found["metadata"]["units"]
    if unit not in UNITS:
        raise InputError(f"{name} is broken: {str(unit)[:20]!r} is no unit of 3MF.")
    return MeshReading(builder.surface(), _left_out(data), unit=UNITS[unit], up="z")


def _check_archive(data: bytes, name: str, maximum: int) -> None:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            files = archive.infolist()
    except (zipfile.BadZipFile, zipfile.LargeZipFile, ValueError, OSError) as error:
        raise InputError(f"{name} is no 3MF file: it is no .zip that can be read.") from error
    # A .zip unpacks to no more than is declared here.
    if len(files) > MAX_FILES or sum(file.file_size for file in files) > maximum:
        raise InputError(
            f"{name} holds more than {MAX_FILES} files, or more than {maximum // 1_000_000} MB "
            f"when "
            "unpacked; save it coarser."
        )
    if all(MODEL not in file.filename.lower() for file in files):
        raise InputError(f"{name} is no 3MF file: there is no 3D/3dmodel.model in it.")


def _surface(mesh: dict[str, Any], name: str) -> MeshSurface:
    faces = np.asarray(mesh["faces"], dtype=np.int64).reshape(-1, 3)
    return of_polygons(mesh["vertices"], faces.ravel(), np.full(len(faces), 3), name)


def _left_out(data: bytes) -> tuple[str, ...]:
    """Return in words what trimesh does not read."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        model = next(file for file in archive.infolist() if MODEL in file.filename.lower())
        text = archive.read(model)
    return ("colours and materials",) if b" pid=" in text else ()
