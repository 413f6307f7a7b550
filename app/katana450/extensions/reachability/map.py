"""The reachability map: voxels that the tool reaches, with the fraction of orientations in each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.reachability.pose_reachability import PoseReachability
from katana450.extensions.reachability.reachability import (
    BoolArray,
    IntArray,
    Reachability,
    VoxelGrid,
)
from katana450.maths.geometry.arrays import FloatArray

POSES = 65536
"""Poses per chunk: 50 MB each, and enough chunks for a progress bar and all cores."""


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """The result of a survey, in the base frame [m].

    Attributes:
        points: (N, 3) centres of the voxels with at least one orientation, in the order of the
            grid.
        fraction: (N,) fraction of orientations in each voxel, above 0 and up to 1.
        at_home: (N,) whether the orientation of the tool at Home is possible there; None for an arm
            whose map does not tell.
    """

    points: FloatArray
    fraction: FloatArray
    at_home: BoolArray | None = None


@dataclass(frozen=True, eq=False)
class Survey:
    """The computation of one map, in chunks that are independent and can run in any order.

    Attributes:
        reachability: the arm and the tested orientations.
        voxel: edge of a voxel [m].

    Raises InputError for an invalid voxel or table.
    """

    reachability: Reachability | PoseReachability
    voxel: float

    def __post_init__(self) -> None:
        # Computed now, because it may raise InputError.
        _ = self.grid

    @cached_property
    def grid(self) -> VoxelGrid:
        """The voxels of the survey."""
        return self.reachability.grid(self.voxel)

    def chunks(self) -> list[range]:
        """Return the chunks, the arguments of ``count``."""
        return self.grid.chunks(max(1, POSES // self.reachability.poses_at_once))

    def count(self, chunk: range) -> IntArray:
        """Return what is possible in each voxel of ``chunk``, see ``count`` of the reachability."""
        return self.reachability.count(self.grid.centers(chunk))

    def map(self, counts: Iterable[IntArray]) -> ReachabilityMap:
        """Return the map from the counts of all chunks in their order."""
        found = np.concatenate(list(counts))
        at_home = None
        if found.ndim == 2:
            found, home = found.T
            at_home = home[found > 0] > 0
        reached = np.flatnonzero(found)
        return ReachabilityMap(
            points=self.grid.centers(reached),
            fraction=found[reached] / self.reachability.orientations,
            at_home=at_home,
        )
