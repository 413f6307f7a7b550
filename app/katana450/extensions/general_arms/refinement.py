"""Newton's method on many postures at once, on the chain as its file describes it.

A step solves (J'J + |e|^2 / 100) dq = J'e, where e is the twist from the tool to the pose and J the
Jacobian, both in the frame of the tool. With this damping the error also falls quadratically at
postures without a regular Jacobian (Yamashita and Fukushima 2001), where two solutions meet.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain

STEPS: Final = 12
"""Maximum number of steps."""

DOUBLE: Final = 1e-14
"""[rad], [m] Error that needs no further step."""

GAIN: Final = 0.5
"""[1] Ratio of the errors after and before a step above which a posture leads to none that is
exact. Where two postures meet, a step leaves a quarter."""

ERROR_WEIGHT: Final = 0.01
"""[1] Damping of a step, relative to the squared error."""

DAMPING: Final = 1e-15
"""[1] Damping of a step at an exact posture, which keeps a singular matrix solvable."""


class Refined(NamedTuple):
    """Postures after the steps.

    Attributes:
        q: (N, n) joint angles [rad].
        error: (N,) the largest component of the twist from the tool to the pose [rad], [m].
        J: (N, 6, n) Jacobian in the frame of the tool.
    """

    q: FloatArray
    error: FloatArray
    J: FloatArray


def refined(
    chain: Chain, q: FloatArray, T: FloatArray, within: float, locked: tuple[int, ...] = ()
) -> Refined:
    """Return the postures near `q` (N, n) [rad] that take the poses `T` (N, 4, 4).

    Args:
        chain: the chain.
        q: the first postures.
        T: their poses.
        within: error [rad], [m] up to which a posture is refined. Others stay.
        locked: joints that stay.
    """
    error, J = _looked(chain, q, T)
    best = Refined(np.array(q), np.abs(error).max(axis=1, initial=0.0), J)
    active = np.flatnonzero((best.error > DOUBLE) & (best.error <= within))
    error = error[active]
    for _ in range(STEPS):
        if not len(active):
            break
        J = best.J[active]
        J[:, :, list(locked)] = 0.0
        transposed = J.swapaxes(1, 2)
        A = transposed @ J
        square = np.einsum("ni,ni->n", error, error)
        A.reshape(len(A), -1)[:, :: chain.n + 1] += ERROR_WEIGHT * square[:, None] + DAMPING
        dq = np.linalg.solve(A, transposed @ error[:, :, None])[:, :, 0]
        candidate = best.q[active] + dq
        error, J = _looked(chain, candidate, T[active])
        size = np.abs(error).max(axis=1)
        before = best.error[active]
        is_better = size < before
        places = active[is_better]
        best.q[places], best.error[places] = candidate[is_better], size[is_better]
        best.J[places] = J[is_better]
        continues = (size < GAIN * before) & (size > DOUBLE)
        active, error = active[continues], error[continues]
    return best


def _looked(chain: Chain, q: FloatArray, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the error (N, 6) of postures and their Jacobian (N, 6, n), in the frame of the tool.

    The product of exponentials is formed from the tool to the base, as in `forward_columns`. Before
    the factor of a joint it is the pose of the tool with this joint at the base, where hat(S) gives
    the velocity of the tool point.
    """
    pose: FloatArray = np.empty((4, 4, len(q)))
    pose[:] = chain.M[:, :, None]
    J = np.empty((len(q), 6, chain.n))
    sines, versines = np.sin(q.T), 2.0 * np.sin(0.5 * q.T) ** 2
    for i in range(chain.n)[::-1]:
        flat = pose.reshape(4, -1)
        turned = (chain.generators[i] @ flat).reshape(pose.shape)
        twice = (chain.generators_squared[i] @ flat).reshape(pose.shape)
        R = pose[:3, :3]
        J[:, :3, i] = np.einsum("jin,j->ni", R, chain.S[:3, i])
        J[:, 3:, i] = np.einsum("jin,jn->ni", R, turned[:3, 3])
        pose = pose + sines[i] * turned + versines[i] * twice
    R = pose[:3, :3]
    left = np.einsum("jin,njk->nik", R, T[:, :3, :3])
    error = np.empty((len(q), 6))
    error[:, 0] = 0.5 * (left[:, 2, 1] - left[:, 1, 2])
    error[:, 1] = 0.5 * (left[:, 0, 2] - left[:, 2, 0])
    error[:, 2] = 0.5 * (left[:, 1, 0] - left[:, 0, 1])
    error[:, 3:] = np.einsum("jin,jn->ni", R, T[:, :3, 3].T - pose[:3, 3])
    return error, J
