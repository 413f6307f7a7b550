"""A box of cubic voxels around the reach of the arm, divided into independent chunks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array

IntArray = npt.NDArray[np.int64]
"""An array of 64-bit integers."""

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

    def chunks(self, length: int) -> list[range]:
        """Return all flat indices in their order, in ranges of ``length``."""
        return [range(len(self))[at : at + length] for at in range(0, len(self), length)]

    def centers(self, indices: npt.ArrayLike) -> FloatArray:
        """Return the centres (N, 3) of the voxels ``indices`` (N,), in the base frame [m]."""
        cells = np.stack(np.unravel_index(np.asarray(indices, dtype=np.int64), self.shape), axis=-1)
        centers: FloatArray = (cells + np.array(self.first) + 0.5) * self.size
        return centers
