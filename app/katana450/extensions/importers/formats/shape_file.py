"""Shapes of other programs as triangles in metres, z up: meshes and worlds in seven formats.

Files are untrusted. Readers see no file but those of the same upload, execute nothing, and stop at
limits of their own. `read_shape_guarded` adds limits of the system, in a disposable subprocess.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from katana450.arm.robot.surfaces import Colours
from katana450.errors import InputError, digits_beyond
from katana450.extensions.importers.archive import MAX_ARCHIVE_BYTES, Companions, packed, unpacked
from katana450.extensions.importers.formats.gltf_file import read_gltf
from katana450.extensions.importers.formats.obj_file import read_obj
from katana450.extensions.importers.formats.ply_file import read_ply
from katana450.extensions.importers.formats.stl_file import read_stl
from katana450.extensions.importers.formats.surface import MeshReading, MeshSurface
from katana450.extensions.importers.formats.vrml_file import read_wrl
from katana450.maths.geometry.arrays import FloatArray, IntArray

MAX_FILE_BYTES = 20_000_000
"""[bytes] Maximum size of a file."""

MAX_SIZE, MIN_SIZE = 2.0, 1e-3
"""[m] Bounds of the longest side. They repeat those of arm/control/scene_objects, which takes long
to import.
"""

SMALL = 1e-2
"""[m] Minimum length of an object that is enlarged to be placed."""

SCALES = (*(step * 10.0**power for power in range(-3, 3) for step in (1.0, 2.0, 5.0)), 1e3)
"""[1] Factors that are proposed, within the bounds of those of an object."""

ROUNDING = 1e-6
"""[1] Relative tolerance of a bound, for lengths rounded to single precision."""

LONGEST_NAME = 40
"""Maximum number of characters of a name, of objects too."""

SECONDS = 15.0
"""[s] Maximum processor time of reading a file."""

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
    THREEMF = "3mf"
    ZIP = "zip"

    @property
    def max_bytes(self) -> int:
        """The maximum size of a file [bytes]."""
        return MAX_ARCHIVE_BYTES if self is Format.ZIP else MAX_FILE_BYTES

    @classmethod
    def of(cls, file: str) -> Format:
        """Return the format of a file by its name. Raises InputError."""
        suffix = file.rpartition(".")[2].lower() if "." in file else ""
        known = {member.value: member for member in cls}
        if suffix not in known:
            raise InputError(
                f"{label(file)} has an unknown format. Use a file that ends in "
                f"{', '.join(f'.{suffix}' for suffix in known)}."
            )
        return known[suffix]


SHAPE_SUFFIXES = tuple(member.value for member in Format if member is not Format.ZIP)
"""Suffixes of files with a shape."""

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
        scale: factor with which it is small and large enough to be placed; 1 if it is as it is.
        format, file: the file as it can be read again: a .zip if it needs other files.
    """

    name: str
    vertices: FloatArray
    faces: IntArray
    colours: Colours | None
    unit: float
    text: str
    scale: float
    format: Format
    file: bytes

    def __post_init__(self) -> None:
        for array in (self.vertices, self.faces, self.colours):
            if array is not None:
                array.setflags(write=False)


def read_shape(
    data: bytes,
    format: Format,
    name: str,
    unit: float | None = None,
    up: Up | None = None,
    *,
    main: str = "",
) -> ShapeFile:
    """Return the shape in a file.

    Args:
        data: content of the file, or of a .zip of it and the files that it names.
        format: its format.
        name: its name, with or without folders.
        unit: its unit [m]; None to guess it.
        up: its axis that points up; None for the default of the format.
        main: path of the shape file in a .zip; chosen if it is left out.

    Raises ChoiceError for a .zip of several shapes, and InputError for a file that is corrupt, too
    large, or of another format.
    """
    file = label(name)
    check_file(data, file, unit, format)
    others: dict[str, bytes] = {}
    path = ""
    if format is Format.ZIP:
        path, others = unpacked(data, file, SHAPE_SUFFIXES, main)
        name, format, data = path, Format.of(path), others[path]
        file = label(name)
        check_file(data, file, unit, format)
    companions = Companions(others, path)
    try:
        reading = _read(data, format, file, companions)
    except RecursionError as error:
        raise InputError(f"{file} is corrupt: its parts are nested too deeply.") from error
    reading = _in_known_unit(reading)
    surface = reading.surface.tidy()
    left_out = [*reading.left_out]
    if degenerate := len(reading.surface.faces) - len(surface.faces):
        left_out.append(f"{degenerate} degenerate triangle{'' if degenerate == 1 else 's'}")
    if not len(surface.faces):
        without = f" It has {_listed(left_out)}." if left_out else ""
        hint = _not_there(companions) or " An object needs a surface: save it with faces."
        raise InputError(f"{file} has no triangles.{without}{hint}")
    sides = np.ptp(surface.vertices, axis=0)
    longest = float(sides.max())
    metres, why = _unit(format, longest, unit, reading.unit)
    scale = fitting_scale(longest * metres)
    if scale is None:
        raise _beyond(longest, metres, file)
    axis = up or (Up.Y if format in Y_UP else Up.Z)
    vertices = surface.vertices * metres
    if axis is Up.Y:
        vertices = vertices[:, (0, 2, 1)] * (1.0, -1.0, 1.0)
    text = f"{_size(vertices, surface)}; {why}; {_turned(axis, up)}."
    if left_out:
        text += f" Left out: {_listed(left_out)}."
    text += _not_there(companions) + _scaled(longest, metres, scale)
    used = {companion: others[companion] for companion in companions.used if companion != path}
    unread = [
        label(companion)
        for companion in others
        if companion.lower().endswith(SHAPE_SUFFIXES)
        and companion not in used
        and companion != path
    ]
    if unread:
        text += f" Other shapes of the .zip were not read: {_listed(unread)}."
    if used:
        data, format = packed(path, {path: data} | used), Format.ZIP
    return ShapeFile(
        object_name(name),
        vertices,
        surface.faces,
        surface.colours,
        metres,
        text,
        scale,
        format,
        data,
    )


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


def check_file(data: bytes, file: str, unit: float | None, format: Format) -> None:
    """Raise InputError for a file that is too large, or a unit that is not a length."""
    if len(data) > format.max_bytes:
        raise InputError(
            f"{file} has {len(data) / 1e6:.1f} MB; at most {format.max_bytes // 1_000_000} are "
            "read. Save it coarser, or as a binary file."
        )
    if unit is not None and not (math.isfinite(unit) and unit > 0.0):
        raise InputError(f"The unit must be a length in metres above 0, not {unit}.")


def _read(data: bytes, format: Format, file: str, companions: Companions) -> MeshReading:
    match format:
        case Format.WRL:
            return read_wrl(data, file, companions)
        case Format.STL:
            return read_stl(data, file)
        case Format.OBJ:
            return read_obj(data, file, companions)
        case Format.PLY:
            return read_ply(data, file)
        # The library for this format takes longer to import than a file takes to read.
        case Format.THREEMF:
            from katana450.extensions.importers.formats.threemf_file import read_3mf

            return read_3mf(data, file, MAX_FILE_BYTES)
    return read_gltf(data, file, companions)


def _not_there(companions: Companions) -> str:
    """Return a sentence on the files that a file names and that are not there."""
    names = tuple(companions.missing)
    if not names:
        return ""
    return (
        f" It names files that are not there: {_listed(names)}. Add them together with it, as "
        "their folder or as a .zip."
    )


def _in_known_unit(reading: MeshReading) -> MeshReading:
    """Return the reading in metres if its unit is not in UNITS, else unchanged."""
    if reading.unit is None or reading.unit in UNITS.values():
        return reading
    surface = reading.surface
    scaled = replace(surface, vertices=surface.vertices * reading.unit)
    return replace(reading, surface=scaled, unit=1.0)


def _unit(
    format: Format, longest: float, chosen: float | None, of_file: float | None
) -> tuple[float, str]:
    """Return the unit [m], and a clause on its source."""
    if chosen is not None:
        return chosen, f"the unit is {_sign(chosen)}, as given"
    if of_file is not None:
        return of_file, f"the unit is {_sign(of_file)}, as in the file"
    if format in (Format.GLB, Format.GLTF):
        return 1.0, "the unit is m, as in all glTF files"
    if longest > MAX_SIZE * (1.0 + ROUNDING):
        metres = digits_beyond(longest, 0.0, MAX_SIZE)
        return 1e-3, f"the unit is assumed to be mm, since {metres} m would be too large"
    return 1.0, f"the unit is assumed to be m, since {longest:.4g} mm would be small"


def _sign(unit: float) -> str:
    return next((sign for sign, metres in UNITS.items() if metres == unit), f"{unit:g} m")


def fitting_scale(length: float) -> float | None:
    """Return a round factor with which an object of ``length`` [m] can be placed.

    1 if it can be as it is; None if none of the possible factors is enough.
    """
    if MIN_SIZE * (1.0 - ROUNDING) <= length <= MAX_SIZE * (1.0 + ROUNDING):
        return 1.0
    if length > MAX_SIZE:
        return next((scale for scale in SCALES[::-1] if scale * length <= MAX_SIZE), None)
    return next((scale for scale in SCALES if scale * length >= SMALL), None)


def _scaled(longest: float, unit: float, scale: float) -> str:
    """Return a sentence on the factor with which an object can be placed; empty for 1."""
    if scale == 1.0:
        return ""
    length = longest * unit
    size = digits_beyond(1e3 * length, 1e3 * MIN_SIZE, 1e3 * MAX_SIZE)
    bound = f"over {1e3 * MAX_SIZE:g}" if length > MAX_SIZE else f"under {1e3 * MIN_SIZE:g}"
    fitting = [s for s, metres in UNITS.items() if fitting_scale(longest * metres) == 1.0]
    hint = f", or read it with the unit {' or '.join(fitting)}" if fitting else ""
    return (
        f" It is {size} mm long, {bound} mm: place it with the scale {scale:g}, "
        f"{1e3 * scale * length:.4g} mm long{hint}."
    )


def _beyond(longest: float, unit: float, file: str) -> InputError:
    """Return the error for a size that no scale makes fit."""
    fitting = [sign for sign, metres in UNITS.items() if fitting_scale(longest * metres)]
    hint = f"it would fit with the unit {' or '.join(fitting)}" if fitting else "no unit would fit"
    low, high = (SMALL / SCALES[-1], MAX_SIZE / SCALES[0])
    size = digits_beyond(1e3 * longest * unit, 1e3 * low, 1e3 * high)
    return InputError(
        f"{file} would be {size} mm long, with {_sign(unit)} as its unit; with a scale, "
        f"{1e3 * low:g} to {1e3 * high:g} mm can be placed, and {hint}."
    )


def _size(vertices: FloatArray, surface: MeshSurface) -> str:
    x, y, z = (f"{side * 1e3:.4g}" for side in np.ptp(vertices, axis=0))
    count = len(surface.faces)
    return f"{count} triangle{'s' if count > 1 else ''}, {x} × {y} × {z} mm"


def _turned(axis: Up, chosen: Up | None) -> str:
    why = ", as given" if chosen is not None else ""
    return f"z is up{why}" if axis is Up.Z else f"y of the file is up{why}, and rotated to z"


def _listed(parts: Sequence[str]) -> str:
    few = [part if len(part) <= LONGEST_NAME else f"{part[:LONGEST_NAME]}…" for part in parts[:8]]
    return ", ".join(few) + (f" and {len(parts) - 8} more" if len(parts) > 8 else "")
