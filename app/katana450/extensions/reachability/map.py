"""The reachability map: voxels that the tool reaches, with the fraction of orientations in each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.general_arms.choice import kinematics_of
from katana450.extensions.general_arms.numerical import Numerical
from katana450.extensions.general_arms.swivel import SevenAxes
from katana450.extensions.reachability.reachability import FREE_AXES, Reachability
from katana450.maths.geometry.arrays import FloatArray, finite_array
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.kinematics import FiveAxisKinematics, Kinematics

POSES: Final = 65536
"""Number of poses that are solved at once; they take 50 MB."""


MIN_VOXEL = 1e-3
"""[m] Minimum edge of a voxel: the accuracy of the arm's joints at the tool."""


def voxel_ranges(
    middle: npt.ArrayLike, reach: float, size: float, table: float
) -> tuple[range, range, range]:
    """Return the numbers in x, y, z of the voxels of the ball of ``reach`` [m] about ``middle``.

    Voxel i has the edge ``size`` [m] and begins at i * size in the base frame. ``table`` is a
    height z [m]; voxels with their centre below it are left out. Raises InputError for an invalid
    ``size``, and for a table above the reach.
    """
    centre = finite_array(middle, (3,), "The centre of the reach")
    if not MIN_VOXEL <= size <= reach:
        raise InputError(
            f"The edge of a voxel is {1e3 * size:g} mm; it must be from "
            f"{1e3 * MIN_VOXEL:g} to {1e3 * reach:.0f} mm."
        )
    top = float(centre[2]) + reach
    if not -math.inf < table < top:
        raise InputError(
            f"A table at {1e3 * table:g} mm leaves no reachable space above it. The tool "
            f"reaches up to {1e3 * top:.0f} mm."
        )
    low = np.floor((centre - reach) / size).astype(int).tolist()
    high = np.ceil((centre + reach) / size).astype(int).tolist()
    low[2] = max(low[2], math.ceil(table / size - 0.5))
    high[2] = max(high[2], low[2] + 1)
    x, y, z = map(range, low, high)
    return x, y, z


def voxel_centers(ranges: tuple[range, range, range], size: float) -> FloatArray:
    """Return the centres (N, 3) of all voxels of ``ranges`` in the base frame [m], z first."""
    axes = [(np.array(numbers) + 0.5) * size for numbers in ranges]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """The points that a tool reaches, in the base frame [m].

    Attributes:
        points: (N, 3) centres of the voxels with at least one orientation.
        fraction: (N,) fraction of orientations in each voxel, above 0 and up to 1.
    """

    points: FloatArray
    fraction: FloatArray


ROUND: Final = 0.005
"""[m] The edge of a voxel is a multiple of this by default."""


class Fineness(NamedTuple):
    """The fineness of the map of an arm.

    Attributes:
        voxels: number of voxels from the middle of the reach to its end.
        pitches, rolls: numbers of steps.
        poses: maximum number of poses in the box around the reach.
    """

    voxels: int
    pitches: int
    rolls: int
    poses: int


FAMILY: Final = Fineness(32, 36, 24, 2_000_000_000)
CLOSED: Final = Fineness(16, 24, 6, 100_000_000)
SWIVEL: Final = Fineness(10, 12, 4, 10_000_000)
POINTS: Final = Fineness(10, 1, 1, 200_000)


def reachability_map(
    chain: Chain, T_base_shoulder: FloatArray, table: float = 0.0, voxel: float | None = None
) -> ReachabilityMap:
    """Return the map of the arm ``chain``.

    Args:
        chain: the arm with its tool, in {S}.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
        table: height of the table in the base frame [m].
        voxel: edge of a voxel [m]; None for what suits the arm.

    Raises InputError for a value out of range, and for a map that would take too long.
    """
    kinematics = kinematics_of(chain)
    fineness = _fineness(kinematics)
    arm = Reachability(chain, T_base_shoulder, table, fineness.pitches, fineness.rolls)
    if voxel is None:
        voxel = ROUND * math.ceil(arm.reach / fineness.voxels / ROUND)
    ranges = voxel_ranges(arm.middle, arm.reach, voxel, table)
    poses = math.prod(map(len, ranges)) * arm.orientations.number
    if poses > fineness.poses:
        raise InputError(
            f"The map would take {poses:.2g} poses, and at most {fineness.poses:.0e} are tried for "
            f"this arm ({kinematics.method}). Choose larger voxels than {1e3 * voxel:g} mm."
        )
    centers = voxel_centers(ranges, voxel)
    step = max(1, POSES // arm.orientations.poses_at_once)
    starts = range(0, len(centers), step)
    counts = np.concatenate([arm.count(centers[start : start + step]) for start in starts])
    reached = np.flatnonzero(counts)
    return ReachabilityMap(centers[reached], counts[reached] / arm.orientations.number)


def _fineness(kinematics: Kinematics) -> Fineness:
    if isinstance(kinematics, FiveAxisKinematics):
        return FAMILY
    if isinstance(kinematics, SevenAxes):
        return SWIVEL
    is_closed = not isinstance(kinematics, Numerical) and kinematics.chain.n >= FREE_AXES
    return CLOSED if is_closed else POINTS
