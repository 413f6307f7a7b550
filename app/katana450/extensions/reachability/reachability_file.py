"""A reachability map as .npz, to be read again, and as .ply, for programs that show points.

Keys of the .npz, lengths in m, angles in rad, points in the base frame:

    format           "katana450 reachability 1"
    points (N, 3)    centres of the voxels the tool reaches
    share (N,)       of orientations it can have there, above 0 and up to 1
    cloud (K, 3)     tool points at random joint angles
    voxel, table     edge of a voxel; height of the table
    pitches, rolls   in how many steps a turn was cut
    robot, tool      name of the arm and of its tool frame
    seed             of the cloud
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
from katana450.extensions.reachability.colors import share_colors
from katana450.extensions.reachability.map import ReachabilityMap, Survey
from katana450.maths.geometry.arrays import FloatArray, finite_array

FORMAT = "katana450 reachability 1"
ZIP = b"PK"
"""What an .npz, being a .zip, begins with."""


@dataclass(frozen=True, eq=False)
class StoredMap:
    """A map as it was read.

    points: (N, 3) centres of voxels of edge `voxel` in the base frame [m]. share: (N,) of the
    orientations, above 0 and up to 1. robot, tool: which arm and which of its tools it is of.
    """

    points: FloatArray
    fraction: FloatArray
    voxel: float
    robot: str
    tool: str


def write_npz(
    file: BinaryIO, survey: Survey, found: ReachabilityMap, robot: str, tool: str
) -> None:
    """Write everything; the same map gives the same bytes."""
    reachability = survey.reachability
    np.savez_compressed(
        file,
        allow_pickle=False,
        format=np.array(FORMAT),
        points=found.points,
        fraction=found.fraction,
        cloud=found.cloud,
        voxel=np.array(survey.voxel),
        table=np.array(reachability.table),
        pitches=np.array(reachability.pitches),
        rolls=np.array(reachability.rolls),
        robot=np.array(robot),
        tool=np.array(tool),
        seed=np.array(survey.seed),
    )


def load_map(path: str | os.PathLike[str]) -> StoredMap:
    """The map in an .npz file, its arrays read-only.

    Raises InputError for a file that is missing, no such map or broken.
    """
    name = Path(path)
    try:
        with name.open("rb") as file:
            # Else numpy takes it for a pickle, and advises to trust it.
            if file.read(len(ZIP)) != ZIP:
                raise ValueError("it is no .npz file")
            file.seek(0)
            arrays = np.load(file, allow_pickle=False)
            if str(arrays["format"]) != FORMAT:
                raise ValueError(f"its format is {arrays['format']}, not {FORMAT}")
            points, fraction = arrays["points"], arrays["fraction"]
            voxel, robot, tool = (arrays[key].item() for key in ("voxel", "robot", "tool"))
    except OSError as error:
        raise InputError(f"{name} cannot be read: {error.strerror or error}.") from error
    except Exception as error:
        raise InputError(f"{name} is no reachability map, or is broken: {error}.") from error
    if not (isinstance(voxel, float) and isinstance(robot, str) and isinstance(tool, str)):
        raise InputError(f"'voxel' of {name} must be a number, 'robot' and 'tool' must be names.")
    if not 0.0 < voxel < math.inf:
        raise InputError(f"The voxels of {name} have an edge of {voxel} m, which is none.")
    return StoredMap(*_checked(name, points, fraction), voxel, robot, tool)


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


def write_ply(file: BinaryIO, found: ReachabilityMap) -> None:
    """The voxel centres as binary .ply: x, y, z [m], colour, and the fraction as a property."""
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        "comment Katana450 reachability: metres in the base frame, fraction of orientations\n"
        f"element vertex {len(found.points)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        "property float share\nend_header\n"
    )
    vertices = np.empty(
        len(found.points), dtype=[("xyz", "<f4", 3), ("color", "u1", 3), ("fraction", "<f4")]
    )
    vertices["xyz"] = found.points
    vertices["color"] = share_colors(found.fraction)
    vertices["fraction"] = found.fraction
    file.write(header.encode("ascii"))
    file.write(vertices.tobytes())
