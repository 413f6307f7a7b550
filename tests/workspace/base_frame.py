"""Points of the shoulder frame in the base frame, for the tests of reachability."""

from __future__ import annotations

from katana450.extensions.reachability.reachability import Reachability
from katana450.maths.geometry.arrays import FloatArray


def in_base(reachability: Reachability, p: FloatArray) -> FloatArray:
    """Return points ``p`` (N, 3) of {S} in the base frame [m]."""
    T = reachability.T_base_shoulder
    return p @ T[:3, :3].T + T[:3, 3]
