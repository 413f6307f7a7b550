"""3MF, read with trimesh.

Source: 3MF Consortium, 3MF Core Specification 1.3. The size of the archive is checked before it is
unpacked. trimesh expands no entity and opens no file outside of the archive.
"""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
from trimesh.exchange.threemf import load_3MF

from katana450.errors import InputError
from katana450.extensions.importers.formats.surface import (
    MAX_COPIES,
    MeshBuilder,
    MeshReading,
    MeshSurface,
    failures_in_words,
    of_polygons,
)
from katana450.extras import require

MAX_FILES = 256
"""Maximum number of files of an archive."""

MODEL = "3d/3dmodel.model"
"""Path of the model in the archive, in lower case."""

UNITS = {
    **{"micron": 1e-6, "millimeter": 1e-3, "millimeters": 1e-3, "centimeter": 1e-2},
    **{"inch": 0.0254, "foot": 0.3048, "meter": 1.0},
}
"""[m] Units of the specification, and trimesh's word for a file without a unit."""


def read_3mf(data: bytes, name: str, maximum: int) -> MeshReading:
    """Return the triangles of all items of the build. Raises InputError if there are none.

    ``maximum`` [bytes] limits the total size of the files of the archive.
    """
    _check_archive(data, name, maximum)
    require("networkx", "meshes", "3MF files")
    builder = MeshBuilder(name)
    with failures_in_words(name):
        scene = load_3MF(io.BytesIO(data))  # type: ignore[no-untyped-call]
        surfaces = {key: _surface(mesh, name) for key, mesh in scene["geometry"].items()}
        for number, item in enumerate(scene["graph"]):
            if number >= MAX_COPIES:
                raise InputError(f"{name} shows more than {MAX_COPIES} objects.")
            if item["geometry"] in surfaces:
                builder.add(surfaces[item["geometry"]].moved(np.asarray(item["matrix"])))
        unit = scene["metadata"]["units"]
    if unit not in UNITS:
        raise InputError(f"{name} is corrupt: {str(unit)[:20]!r} is not a unit of 3MF.")
    return MeshReading(builder.surface(), _left_out(data), unit=UNITS[unit])


def _check_archive(data: bytes, name: str, maximum: int) -> None:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            files = archive.infolist()
    except (zipfile.BadZipFile, zipfile.LargeZipFile, ValueError, OSError) as error:
        raise InputError(f"{name} is not a 3MF file: it cannot be read as a .zip.") from error
    # zipfile never unpacks more than the size that is declared here.
    if len(files) > MAX_FILES or sum(file.file_size for file in files) > maximum:
        raise InputError(
            f"{name} has more than {MAX_FILES} files, or more than {maximum // 1_000_000} MB when "
            "unpacked. Save it coarser."
        )
    if all(MODEL not in file.filename.lower() for file in files):
        raise InputError(f"{name} is not a 3MF file: it has no 3D/3dmodel.model.")


def _surface(mesh: dict[str, Any], name: str) -> MeshSurface:
    faces = np.asarray(mesh["faces"], dtype=np.int64).reshape(-1, 3)
    return of_polygons(mesh["vertices"], faces.ravel(), np.full(len(faces), 3), name)


def _left_out(data: bytes) -> tuple[str, ...]:
    """Return the names of the parts that trimesh does not read."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        model = next(file for file in archive.infolist() if MODEL in file.filename.lower())
        text = archive.read(model)
    return ("colours and materials",) if b" pid=" in text else ()
