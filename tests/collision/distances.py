"""The distances of some pairs of a world."""

from __future__ import annotations

import numpy as np

from katana450.maths.collision.world import IndexArray, PlacedWorld
from katana450.maths.geometry.arrays import FloatArray


def distances(placed: PlacedWorld, pairs: IndexArray) -> FloatArray:
    """Return the distances (k,) [m] of ``pairs`` (k,)."""
    return np.array([placed.distance(pair) for pair in pairs.tolist()])
