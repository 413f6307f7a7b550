"""Many poses and postures at once, in the shape the workspace is worked out in."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.inverse import inverse


def at(chain: Chain, T: FloatArray) -> FloatArray:
    """(N, 4, 5) joint angles [rad] of every posture for the poses `T` (N, 4, 4) = T_S_tool [m].

    Each angle is in the turn that fits the limits. Postures for a pose out of reach only come near.
    """
    q = [[solution.q for solution in inverse(chain, pose)] for pose in T]
    return np.array(q).reshape(-1, 4, 5)


def poses(chain: Chain, q: FloatArray) -> FloatArray:
    """(N, 4, 4) poses T_S_tool [m] at the joint angles `q` (N, n) [rad]."""
    return np.array([forward(chain, each) for each in q]).reshape(-1, 4, 4)
