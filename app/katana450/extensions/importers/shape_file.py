"""Shapes of other programs as triangles in metres, z up: meshes and worlds in nine formats.

Files are untrusted. Readers open no other file, execute nothing, and stop at limits of their own.
`read_shape_guarded` adds limits of the system, in a disposable subprocess.
"""

from __future__ import annotations

import io
import math
import os
import re
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import IO

import numpy as np

from katana450.arm.robot.creases import Colours
from katana450.errors import InputError, digits_beyond
from katana450.extensions.importers.gltf_file import read_gltf
from katana450.extensions.importers.obj_file import read_obj
from katana450.extensions.importers.off_file import read_off
from katana450.extensions.importers.ply_file import read_ply
from katana450.extensions.importers.stl_file import read_stl
from katana450.extensions.importers.surface import MeshReading, MeshSurface
from katana450.extensions.importers.vrml_file import read_wrl
from katana450.maths.collision.convex_body import ConvexBody
from katana450.maths.geometry.arrays import FloatArray, IntArray, frozen
from katana450.maths.planning.checkpoint import checkpoint

MAX_FILE_BYTES = 20_000_000
"""[bytes] Maximum size of a file."""

MAX_SIZE, MIN_SIZE = 2.0, 1e-3
"""[m] Bounds of the longest side. They repeat those of arm/control/scene_objects, which takes long
to import.
"""

ROUNDING = 1e-6
"""[1] Relative tolerance of a bound, for lengths rounded to single precision."""

LONGEST_NAME = 40
"""Maximum number of characters of a name, of objects too."""

SECONDS = 5.0
"""[s] Timeout of reading a file."""

CHECK_EVERY = 0.1
"""[s] Interval of the checks whether the reading was cancelled."""

MAX_MEMORY_BYTES = 1 << 30
"""[bytes] Maximum memory for reading a file."""

UNITS = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "m": 1.0}
"""[m] Length of each known unit."""


class Format(Enum):
    """A file format, by the suffix of the file."""

    WRL = "wrl"
    STL = "stl"
    OBJ = "obj"
    PLY = "ply"
    GLB = "glb"
    GLTF = "gltf"
    DAE = "dae"
    THREEMF = "3mf"
    OFF = "off"

    @classmethod
    def of(cls, file: str) -> Format:
        """Return the format of a file by its name; .wrz is a compressed .wrl. Raises InputError."""
        suffix = file.rpartition(".")[2].lower() if "." in file else ""
        known = {each.value: each for each in cls} | {"wrz": cls.WRL}
        if suffix not in known:
            raise InputError(
                f"{label(file)} has an unknown format. Use a file that ends in "
                f"{', '.join(f'.{each}' for each in known)}."
            )
        return known[suffix]


Y_UP = (Format.WRL, Format.GLB, Format.GLTF)
"""Formats whose standard has y up."""


class Up(Enum):
    """The axis of a file that points up."""

    Y = "y"
    Z = "z"


@dataclass(frozen=True, eq=False)
class ShapeFile:
    """A shape in metres, z up.

    Attributes:
        name: name for an object, from the name of the file.
        vertices: (n, 3) [m], each used by a face, no two equal.
        faces: (m, 3) indices of vertices, counter-clockwise seen from outside.
        colours: (m, 4) sRGB and opacity of the faces; None if the file has none.
        unit: unit of the file [m].
        text: note for people: unit and its source, number of triangles, size, omitted parts.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    colours: Colours | None
    unit: float
    text: str

    def __post_init__(self) -> None:
        for array in (self.vertices, self.faces, self.colours):
            if array is not None:
                array.setflags(write=False)


def read_shape(
    data: bytes, format: Format, name: str, unit: float | None = None, up: Up | None = None
) -> ShapeFile:
    """Return the shape in a file.

    Args:
        data: content of the file.
        format: its format.
        name: its name, with or without folders.
        unit: its unit [m]; None to guess it.
        up: its axis that points up; None for the default of the format.

    Raises InputError for a file that is corrupt, too large, or of another format.
    """
    file = label(name)
    _check(data, file, unit)
    try:
        reading = _read(data, format, file)
    except RecursionError as error:
        raise InputError(f"{file} is corrupt: its parts are nested too deeply.") from error
    reading = _in_known_unit(reading, file)
    surface = reading.surface.tidy()
    if not len(surface.faces):
        without = f" It has {_listed(reading.left_out)}." if reading.left_out else ""
        raise InputError(f"{file} has no triangles.{without}")
    sides = np.ptp(surface.vertices, axis=0)
    longest = float(sides.max())
    metres, why = _unit(format, longest, unit, reading.unit)
    _check_size(longest, metres, file)
    axis = up or Up(reading.up or ("y" if format in Y_UP else "z"))
    vertices = surface.vertices * metres
    if axis is Up.Y:
        vertices = vertices[:, (0, 2, 1)] * (1.0, -1.0, 1.0)
    text = f"{_size(vertices, surface)}; {why}; {_turned(axis, up)}."
    if reading.left_out:
        text += f" Left out: {_listed(reading.left_out)}."
    return ShapeFile(object_name(name), vertices, surface.faces, surface.colours, metres, text)


def read_shape_guarded(
    data: bytes, format: Format, name: str, unit: float | None = None, up: Up | None = None
) -> tuple[ShapeFile, ConvexBody]:
    """Return the result of `read_shape`, and its convex body, from a subprocess.

    The subprocess has `SECONDS` and, where the system supports it, `MAX_MEMORY_BYTES`. Raises
    InputError as `read_shape`, at these limits, and after a crash; and the error of a `checkpoint`,
    which ends the subprocess.
    """
    file = label(name)
    _check(data, file, unit)
    words = [
        format.value,
        file,
        "" if unit is None else str(float(unit)),
        "" if up is None else up.value,
    ]
    # One thread, because a pool for every core would take address space, which is limited.
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        [sys.executable, "-m", "katana450.extensions.importers.reading", *words],
        # The parent folder of the package.
        cwd=Path(__file__).resolve().parents[3],
        env=environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            output = _output(process, data, file)
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        raise InputError(
            f"{file} cannot be read: it needs more than {SECONDS:g} s or {MAX_MEMORY_BYTES >> 20} "
            "MiB, or the file is corrupt. Try a simpler export."
        )
    with np.load(io.BytesIO(output), allow_pickle=False) as found:
        if "error" in found:
            raise InputError(str(found["error"]))
        shape = ShapeFile(
            object_name(name),
            found["vertices"],
            found["faces"],
            found.get("colours"),
            float(found["unit"]),
            str(found["text"]),
        )
        body = ConvexBody(
            frozen(found["corners"]),
            float(found["off"]),
            bool(found["thickened"]),
            float(found["volume"]),
        )
        return shape, body


def _output(process: subprocess.Popen[bytes], data: bytes, file: str) -> bytes:
    """Return the output of ``process`` for ``data``. Raises InputError after `SECONDS`."""
    # communicate() sends no further input after a timeout, so a separate thread sends all of it.
    threading.Thread(target=_send, args=(process.stdin, data), daemon=True).start()
    process.stdin = None
    due = time.monotonic() + SECONDS
    while True:
        checkpoint()
        try:
            return process.communicate(timeout=CHECK_EVERY)[0]
        except subprocess.TimeoutExpired as error:
            if time.monotonic() > due:
                raise InputError(
                    f"{file} takes longer than {SECONDS:g} s to read. Try a simpler export."
                ) from error


def _send(pipe: IO[bytes], data: bytes) -> None:
    # A process that has ended reads nothing.
    with suppress(OSError), pipe:
        pipe.write(data)


def label(name: str) -> str:
    """Return the name of a file for messages: without folders, and short."""
    last = re.split(r"[\\/]", name)[-1]
    shown = "".join(sign for sign in last if sign.isprintable()).strip()
    if len(shown) > LONGEST_NAME:
        shown = f"{shown[: LONGEST_NAME - 9]}…{shown[-8:]}"
    return shown or "The file"


def object_name(name: str) -> str:
    """Return the name of an object from the name of its file."""
    stem = label(name).rpartition(".")[0].strip()
    return stem or "shape"


def _check(data: bytes, file: str, unit: float | None) -> None:
    if len(data) > MAX_FILE_BYTES:
        raise InputError(
            f"{file} has {len(data) / 1e6:.1f} MB; at most {MAX_FILE_BYTES // 1_000_000} are read. "
            "Save it coarser, or as a binary file."
        )
    if unit is not None and not (math.isfinite(unit) and unit > 0.0):
        raise InputError(f"The unit must be a length in metres above 0, not {unit}.")


def _read(data: bytes, format: Format, file: str) -> MeshReading:
    match format:
        case Format.WRL:
            return read_wrl(data, file, MAX_FILE_BYTES)
        case Format.STL:
            return read_stl(data, file)
        case Format.OBJ:
            return read_obj(data, file)
        case Format.PLY:
            return read_ply(data, file)
        case Format.OFF:
            return read_off(data, file)
        # The libraries for these formats take as long to import as a file takes to read.
        case Format.DAE:
            from katana450.extensions.importers.dae_file import read_dae

            return read_dae(data, file)
        case Format.THREEMF:
            from katana450.extensions.importers.threemf_file import read_3mf

            return read_3mf(data, file, MAX_FILE_BYTES)
    return read_gltf(data, file)


def _in_known_unit(reading: MeshReading, file: str) -> MeshReading:
    """Return the reading in metres if its unit is not in UNITS, else unchanged."""
    if reading.unit is None or reading.unit in UNITS.values():
        return reading
    if not 1e-9 < reading.unit < 1e9:
        raise InputError(f"{file} is corrupt: its unit is {reading.unit:g} m.")
    surface = reading.surface
    scaled = replace(surface, vertices=surface.vertices * reading.unit)
    return replace(reading, surface=scaled, unit=1.0)


def _unit(
    format: Format, longest: float, given: float | None, of_file: float | None
) -> tuple[float, str]:
    """Return the unit [m], and a clause on its source."""
    if given is not None:
        return given, f"the unit is {_sign(given)}, as given"
    if of_file is not None:
        return of_file, f"the unit is {_sign(of_file)}, as in the file"
    if format in (Format.GLB, Format.GLTF):
        return 1.0, "the unit is m, as in all glTF files"
    if longest > MAX_SIZE * (1.0 + ROUNDING):
        return 1e-3, f"the unit is assumed to be mm, since {longest:.4g} m would be too large"
    return 1.0, f"the unit is assumed to be m, since {longest:.4g} mm would be small"


def _sign(unit: float) -> str:
    return next((sign for sign, metres in UNITS.items() if metres == unit), f"{unit:g} m")


def _check_size(longest: float, unit: float, file: str) -> None:
    length = longest * unit
    if MIN_SIZE * (1.0 - ROUNDING) <= length <= MAX_SIZE * (1.0 + ROUNDING):
        return
    fitting = [s for s, metres in UNITS.items() if MIN_SIZE <= longest * metres <= MAX_SIZE]
    hint = f"it would fit with the unit {' or '.join(fitting)}" if fitting else "no unit would fit"
    size = digits_beyond(1e3 * length, 1e3 * MIN_SIZE, 1e3 * MAX_SIZE)
    raise InputError(
        f"{file} would be {size} mm long, with {_sign(unit)} as its unit; "
        f"the range is {MIN_SIZE * 1e3:g} to {MAX_SIZE * 1e3:g} mm, and {hint}."
    )


def _size(vertices: FloatArray, surface: MeshSurface) -> str:
    x, y, z = (f"{side * 1e3:.4g}" for side in np.ptp(vertices, axis=0))
    count = len(surface.faces)
    return f"{count} triangle{'s' if count > 1 else ''}, {x} × {y} × {z} mm"


def _turned(axis: Up, given: Up | None) -> str:
    why = ", as given" if given is not None else ""
    return f"z is up{why}" if axis is Up.Z else f"y of the file is up{why}, and rotated to z"


def _listed(parts: tuple[str, ...]) -> str:
    few = [part if len(part) <= LONGEST_NAME else f"{part[:LONGEST_NAME]}…" for part in parts[:8]]
    return ", ".join(few) + (f" and {len(parts) - 8} more" if len(parts) > 8 else "")
