"""Batches of poses and postures in the shapes that the workspace needs."""

from __future__ import annotations

from katana450.extensions.batch.inverse_batch import inverse_batch
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain


def at(chain: Chain, T: FloatArray) -> FloatArray:
    """Return the joint angles (N, 4, 5) [rad] of all postures for ``T`` (N, 4, 4) = T_S_tool [m].

    Each angle is in the turn that fits the limits. Postures for a pose out of reach are only near
    it.
    """
    return inverse_batch(chain, T).q


def poses(chain: Chain, q: FloatArray) -> FloatArray:
    """Return the poses T_S_tool (N, 4, 4) [m] at the joint angles ``q`` (N, n) [rad]."""
    return forward_batch(chain, q)
