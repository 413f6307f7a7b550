"""The reachability map: voxels the tool reaches, and how freely it can be turned in each."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from katana450.errors import InputError
from katana450.extensions.reachability.cloud import tool_cloud
from katana450.extensions.reachability.grid import IntArray, VoxelGrid
from katana450.extensions.reachability.reachability import Reachability
from katana450.maths.geometry.arrays import FloatArray

POSES = 65536
"""Poses worked on at a time: some 50 MB, and enough chunks for a progress bar and a cluster."""

MAX_MAP_SAMPLES = 1_000_000
"""Their poses take 170 MB."""

MAX_SEED = 2**63 - 1
"""The file of the map keeps it in 64 bits."""


@dataclass(frozen=True, eq=False)
class ReachabilityMap:
    """What was found, all in the base frame [m].

    points: (N, 3) centres of the voxels where at least one orientation can be had, in the order of
    the grid. share: (N,) of how many, above 0 and up to 1. cloud: (K, 3) tool points at random
    joint angles.
    """

    points: FloatArray
    fraction: FloatArray
    cloud: FloatArray


@dataclass(frozen=True, eq=False)
class Survey:
    """The work of one map, cut into chunks that can be done apart, anywhere and in any order.

    voxel: edge [m]. samples: random postures for the cloud. seed: of those. Raises InputError for a
    voxel that makes no grid, a table that leaves none, another number or seed than 0 to the most.
    """

    reachability: Reachability
    voxel: float
    samples: int
    seed: int

    def __post_init__(self) -> None:
        for name, value, maximum in (
            ("number of samples", self.samples, MAX_MAP_SAMPLES),
            ("seed", self.seed, MAX_SEED),
        ):
            if not 0 <= value <= maximum:
                raise InputError(f"The {name} is {value}; give 0 to {maximum}.")
        # Asked for now, because it may refuse.
        _ = self.grid

    @cached_property
    def grid(self) -> VoxelGrid:
        """The voxels looked at."""
        return self.reachability.grid(self.voxel)

    def chunks(self) -> list[range]:
        """What `count` is to be called with."""
        return self.grid.chunks(max(1, POSES // self.reachability.pitches))

    def count(self, chunk: range) -> IntArray:
        """How many orientations can be had in each voxel of `chunk`."""
        return self.reachability.count(self.grid.centers(chunk))

    def map(self, counts: Iterable[IntArray]) -> ReachabilityMap:
        """The map from the counts of all chunks in their order."""
        found = np.concatenate(list(counts))
        reached = np.flatnonzero(found)
        return ReachabilityMap(
            points=self.grid.centers(reached),
            fraction=found[reached] / self.reachability.orientations,
            cloud=tool_cloud(self.reachability, self.samples, self.seed),
        )
