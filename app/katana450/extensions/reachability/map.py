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


@dataclass(frozen=True)
class VoxelGrid:
    """Voxels of edge ``size`` [m] whose corners lie on multiples of it in the base frame.

    Flat indices run over z first.

    Attributes:
        size: edge of a voxel [m].
        first: index of the lowest voxel in x, y, z; voxel i reaches from i * size to (i + 1) *
            size.
        shape: number of voxels in x, y, z.
    """

    size: float
    first: tuple[int, int, int]
    shape: tuple[int, int, int]

    @staticmethod
    def around(center: npt.ArrayLike, reach: float, size: float, table: float) -> VoxelGrid:
        """Return the voxels of the ball of ``reach`` [m] about ``center`` (3,), above ``table``.

        ``table`` is a height z [m]; voxels with their centre below it are left out. Raises
        InputError for an invalid ``size``, and for a table above the reach.
        """
        middle = finite_array(center, (3,), "The centre of the grid")
        if not MIN_VOXEL <= size <= reach:
            raise InputError(
                f"The edge of a voxel is {1e3 * size:g} mm; it must be from "
                f"{1e3 * MIN_VOXEL:g} to {1e3 * reach:.0f} mm."
            )
        top = float(middle[2]) + reach
        if not -math.inf < table < top:
            raise InputError(
                f"A table at {1e3 * table:g} mm leaves no reachable space above it. The tool "
                f"reaches up to {1e3 * top:.0f} mm."
            )
        low = np.floor((middle - reach) / size).astype(int).tolist()
        high = np.ceil((middle + reach) / size).astype(int).tolist()
        low[2] = max(low[2], math.ceil(table / size - 0.5))
        high[2] = max(high[2], low[2] + 1)
        (x, y, z), (nx, ny, nz) = low, (b - a for a, b in zip(low, high, strict=True))
        return VoxelGrid(size, (x, y, z), (nx, ny, nz))

    def __len__(self) -> int:
        return math.prod(self.shape)

    def centers(self, indices: npt.ArrayLike) -> FloatArray:
        """Return the centres (N, 3) of the voxels ``indices`` (N,), in the base frame [m]."""
        cells = np.stack(np.unravel_index(np.asarray(indices, dtype=np.int64), self.shape), axis=-1)
        centers: FloatArray = (cells + np.array(self.first) + 0.5) * self.size
        return centers


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """The points that a tool reaches, in the base frame [m].

    Attributes:
        points: (N, 3) centres of the voxels with at least one orientation, in the order of the
            grid.
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


FAMILY: Final = Fineness(32, 36, 24, 20_000_000_000)
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
    grid = VoxelGrid.around(arm.middle, arm.reach, voxel, table)
    poses = len(grid) * arm.orientations
    if poses > fineness.poses:
        raise InputError(
            f"The map would take {poses:.2g} poses, and at most {fineness.poses:.0e} are tried for "
            f"this arm ({kinematics.method}). Choose larger voxels than {1e3 * voxel:g} mm."
        )
    step = max(1, POSES // arm.poses_at_once)
    counts = np.concatenate(
        [
            arm.count(grid.centers(range(len(grid))[start : start + step]))
            for start in range(0, len(grid), step)
        ]
    )
    reached = np.flatnonzero(counts)
    return ReachabilityMap(grid.centers(reached), counts[reached] / arm.orientations)


def _fineness(kinematics: Kinematics) -> Fineness:
    if isinstance(kinematics, FiveAxisKinematics):
        return FAMILY
    if isinstance(kinematics, SevenAxes):
        return SWIVEL
    is_closed = not isinstance(kinematics, Numerical) and kinematics.chain.n >= FREE_AXES
    return CLOSED if is_closed else POINTS
