"""Files of a reachability map.

Keys of the .npz, lengths in m, angles in rad, points in the base frame:

    format           "katana450 reachability 2"
    points (N, 3)    centres of the voxels that the tool reaches
    fraction (N,)    fraction of orientations there, above 0 and up to 1
    voxel, table     edge of a voxel; height of the table
    robot, tool      name of the arm and of its tool frame
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, fields
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array

FORMAT = "katana450 reachability 2"
"""Value of the key `format`."""
ZIP = b"PK"
"""First bytes of an .npz, which is a .zip."""


@dataclass(frozen=True, eq=False)
class StoredMap:
    """A map from a file.

    Attributes:
        points: (N, 3) centres of voxels in the base frame [m].
        fraction: (N,) fraction of orientations, above 0 and up to 1.
        voxel: edge of a voxel [m].
        table: height of the table [m].
        robot: name of the arm.
        tool: name of the tool frame.
    """

    points: FloatArray
    fraction: FloatArray
    voxel: float
    table: float
    robot: str
    tool: str


def write_npz(file: BinaryIO, stored: StoredMap) -> None:
    """Write the map; the same map gives the same bytes."""
    arrays = {field.name: np.asarray(getattr(stored, field.name)) for field in fields(stored)}
    np.savez_compressed(file, allow_pickle=False, format=np.array(FORMAT), **arrays)


def load_map(path: str | os.PathLike[str]) -> StoredMap:
    """Return the map in an .npz file, with read-only arrays.

    Raises InputError for a file that is missing, corrupt, of another version, or not a map.
    """
    name = Path(path)
    try:
        with name.open("rb") as file:
            # Otherwise numpy takes the file for a pickle, and advises to trust it.
            if file.read(len(ZIP)) != ZIP:
                raise ValueError("it is not an .npz file")
            file.seek(0)
            arrays = np.load(file, allow_pickle=False)
            version = str(arrays["format"])
            if version != FORMAT:
                raise ValueError(f"its format is {version}, not {FORMAT}")
            points, fraction = arrays["points"], arrays["fraction"]
            voxel, table, robot, tool = (
                arrays[key].item() for key in ("voxel", "table", "robot", "tool")
            )
    except OSError as error:
        raise InputError(f"{name} cannot be read: {error.strerror or error}.") from error
    except Exception as error:
        raise InputError(f"{name} is corrupt or not a reachability map: {error}.") from error
    are_numbers = isinstance(voxel, float) and isinstance(table, float)
    if not (are_numbers and isinstance(robot, str) and isinstance(tool, str)):
        raise InputError(
            f"In {name}, 'voxel' and 'table' must be numbers, and 'robot' and 'tool' names."
        )
    if not 0.0 < voxel < math.inf:
        raise InputError(f"In {name}, 'voxel' is {voxel} m; it must be above 0 and finite.")
    return StoredMap(*_checked(name, points, fraction), voxel, table, robot, tool)


def _checked(
    name: Path, points: npt.NDArray[np.generic], fraction: npt.NDArray[np.generic]
) -> tuple[FloatArray, FloatArray]:
    count = len(points) if points.ndim else 0
    checked = finite_array(points, (count, 3), f"The array 'points' of {name}")
    fractions = finite_array(fraction, (count,), f"The array 'fraction' of {name}")
    if not ((fractions > 0.0) & (fractions <= 1.0)).all():
        raise InputError(f"The array 'fraction' of {name} must lie above 0 and up to 1.")
    checked.setflags(write=False)
    fractions.setflags(write=False)
    return checked, fractions
