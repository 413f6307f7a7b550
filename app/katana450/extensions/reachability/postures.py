"""Many poses and postures at once, in the shape the workspace is worked out in."""

from __future__ import annotations

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch, inverse_batch
from katana450.maths.kinematics.chain import Chain


def at(chain: Chain, T: FloatArray) -> FloatArray:
    """(N, 4, 5) joint angles [rad] of every posture for the poses `T` (N, 4, 4) = T_S_tool [m].

    Each angle is in the turn that fits the limits. Postures for a pose out of reach only come near.
    """
    return inverse_batch(chain, T).q


def poses(chain: Chain, q: FloatArray) -> FloatArray:
    """(N, 4, 4) poses T_S_tool [m] at the joint angles `q` (N, n) [rad]."""
    return forward_batch(chain, q)
