"""Tool points by forward kinematics of random joint angles."""

from __future__ import annotations

import numpy as np

from katana450.extensions.reachability import postures
from katana450.extensions.reachability.pose_reachability import PoseReachability
from katana450.extensions.reachability.reachability import Reachability
from katana450.maths.geometry.arrays import FloatArray


def tool_cloud(reachability: Reachability | PoseReachability, count: int, seed: int) -> FloatArray:
    """Return up to ``count`` tool points (K, 3) in the base frame [m], those not below the table.

    The joint angles are uniform inside the limits and follow from ``seed``. Elbow and wrist must be
    above the table too.
    """
    chain = reachability.chain
    q = np.random.default_rng(seed).uniform(chain.lower, chain.upper, (count, chain.n))
    T = postures.poses(chain, q)
    points = reachability.in_base(T[:, :3, 3])
    clear = reachability.clear(q) & (points[:, 2] >= reachability.table)
    cloud: FloatArray = points[clear]
    return cloud
