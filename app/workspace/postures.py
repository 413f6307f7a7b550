"""Many poses and postures at once, in the shape the workspace is worked out in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from app import tolerances
from app.geometry.arrays import FloatArray
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.inverse import inverse

BoolArray = npt.NDArray[np.bool]


class Postures(NamedTuple):
    """Every posture for N poses.

    q: (N, 4, 5) joint angles [rad], each in the turn that fits the limits. exact: (N, 4) whether
    they put the tool there, or only near it.
    """

    q: FloatArray
    exact: BoolArray


def at(chain: Chain, T: FloatArray) -> Postures:
    """Those that put the tool at the poses `T` (N, 4, 4) = T_S_tool [m]."""
    q = np.empty((len(T), 4, chain.n))
    errors = np.empty((len(T), 4, 2))
    for number, pose in enumerate(T):
        for branch, found in enumerate(inverse(chain, pose)):
            q[number, branch] = found.q
            errors[number, branch] = found.position_error, found.rotation_error
    limits = (tolerances.SAME_POSITION, tolerances.SAME_ROTATION)
    return Postures(q, np.asarray((errors <= limits).all(axis=-1)))


def poses(chain: Chain, q: FloatArray) -> FloatArray:
    """(N, 4, 4) poses T_S_tool [m] at the joint angles `q` (N, n) [rad]."""
    return np.array([forward(chain, each) for each in q]).reshape(-1, 4, 4)
