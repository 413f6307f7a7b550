"""Files of a reachability map.

Keys of the .npz, lengths in m, angles in rad, points in the base frame:

    format           "katana450 reachability 2"
    points (N, 3)    centres of the voxels that the tool reaches
    fraction (N,)    fraction of orientations there, above 0 and up to 1
    at_home (N,)     whether the orientation of the tool at Home is possible there; only outside the
                     five-axis family
    voxel, table     edge of a voxel; height of the table
    pitches, rolls   number of steps in a turn; from six axes on of directions, and of turns of each
    robot, tool      name of the arm and of its tool frame
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.reachability.map import ReachabilityMap, Survey
from katana450.extensions.reachability.reachability import BoolArray
from katana450.maths.geometry.arrays import FloatArray, finite_array

FORMAT = "katana450 reachability 2"
"""Value of the key `format`."""
OLD_FORMATS = ("katana450 reachability 1",)
"""Values of the key `format` in files of older versions."""
ZIP = b"PK"
"""First bytes of an .npz, which is a .zip."""


@dataclass(frozen=True, eq=False)
class StoredMap:
    """A map from a file.

    Attributes:
        points: (N, 3) centres of voxels in the base frame [m].
        fraction: (N,) fraction of orientations, above 0 and up to 1.
        voxel: edge of a voxel [m].
        robot: name of the arm.
        tool: name of the tool frame.
        at_home: (N,) whether the orientation at Home is possible; None if the map does not tell.
    """

    points: FloatArray
    fraction: FloatArray
    voxel: float
    robot: str
    tool: str
    at_home: BoolArray | None = None


def write_npz(
    file: BinaryIO, survey: Survey, reach_map: ReachabilityMap, robot: str, tool: str
) -> None:
    """Write the map; the same map gives the same bytes."""
    reachability = survey.reachability
    np.savez_compressed(
        file,
        allow_pickle=False,
        **({} if reach_map.at_home is None else {"at_home": reach_map.at_home}),
        format=np.array(FORMAT),
        points=reach_map.points,
        fraction=reach_map.fraction,
        voxel=np.array(survey.voxel),
        table=np.array(reachability.table),
        pitches=np.array(reachability.pitches),
        rolls=np.array(reachability.rolls),
        robot=np.array(robot),
        tool=np.array(tool),
    )


def load_map(path: str | os.PathLike[str]) -> StoredMap:
    """Return the map in an .npz file, with read-only arrays.

    Raises InputError for a file that is missing, corrupt, of an older version, or not a map.
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
            if version in OLD_FORMATS:
                raise InputError(
                    f"{name} was made by an older version of katana450. "
                    "Run `katana450 workspace` again to replace it."
                )
            if version != FORMAT:
                raise ValueError(f"its format is {version}, not {FORMAT}")
            points, fraction = arrays["points"], arrays["fraction"]
            at_home = arrays.get("at_home")
            voxel, robot, tool = (arrays[key].item() for key in ("voxel", "robot", "tool"))
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{name} cannot be read: {error.strerror or error}.") from error
    except Exception as error:
        raise InputError(f"{name} is corrupt or not a reachability map: {error}.") from error
    if not (isinstance(voxel, float) and isinstance(robot, str) and isinstance(tool, str)):
        raise InputError(
            f"In {name}, 'voxel' must be a number, and 'robot' and 'tool' must be names."
        )
    if not 0.0 < voxel < math.inf:
        raise InputError(f"In {name}, 'voxel' is {voxel} m; it must be above 0 and finite.")
    if at_home is not None and (at_home.dtype != np.bool or at_home.shape != fraction.shape):
        raise InputError(f"The array 'at_home' of {name} must have a truth value for each point.")
    return StoredMap(*_checked(name, points, fraction), voxel, robot, tool, at_home)


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
