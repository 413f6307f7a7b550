"""A box of cubic voxels round what the arm can reach, cut into chunks to be worked on apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray, finite_array

IntArray = npt.NDArray[np.int64]

MIN_VOXEL = 1e-3
"""[m] No joint of the arm is known to less than this at the tool."""


@dataclass(frozen=True)
class VoxelGrid:
    """Voxels of edge `size` [m] whose corners lie on whole multiples of it in the base frame.

    first: index of the lowest voxel in x, y, z: voxel i reaches from i * size to (i + 1) * size.
    shape: how many there are in x, y, z. Flat indices run over z first.
    """

    size: float
    first: tuple[int, int, int]
    shape: tuple[int, int, int]

    @staticmethod
    def around(center: npt.ArrayLike, reach: float, size: float, table: float) -> VoxelGrid:
        """The voxels that hold the ball of radius `reach` [m] round `center` (3,), above `table`.

        `table` is a height z [m]: a voxel whose centre lies below it is left out. Raises InputError
        for a `size` that makes no grid, and for a table above all that can be reached.
        """
        middle = finite_array(center, (3,), "The centre of the grid")
        if not MIN_VOXEL <= size <= reach:
            raise InputError(
                f"A voxel of {1e3 * size:g} mm makes no map; choose one from "
                f"{1e3 * MIN_VOXEL:g} to {1e3 * reach:.0f} mm."
            )
        top = float(middle[2]) + reach
        if not -math.inf < table < top:
            raise InputError(
                f"A table at {1e3 * table:g} mm leaves nothing to reach above it; the tool comes "
                f"up to {1e3 * top:.0f} mm."
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
        """All flat indices in their order, `length` at a time."""
        return [range(len(self))[at : at + length] for at in range(0, len(self), length)]

    def centers(self, indices: npt.ArrayLike) -> FloatArray:
        """(N, 3) centres of the voxels with flat `indices` (N,), in the base frame [m]."""
        cells = np.stack(np.unravel_index(np.asarray(indices, dtype=np.int64), self.shape), axis=-1)
        centers: FloatArray = (cells + np.array(self.first) + 0.5) * self.size
        return centers
