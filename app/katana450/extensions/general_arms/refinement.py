"""Newton's method on many postures at once, on the chain as its file describes it.

A step solves (J'J + |e|^2 / 100) dq = J'e, where e is the twist from the tool to the pose and J the
Jacobian, both in the frame of the tool. With this damping the error also falls quadratically at
postures without a regular Jacobian (Yamashita and Fukushima 2001), where two solutions meet.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import jacobian_batch
from katana450.maths.kinematics.chain import Chain

STEPS: Final = 20
"""Maximum number of steps."""

DOUBLE: Final = 1e-14
"""[rad], [m] Error that needs no further step."""

GAIN: Final = 0.9
"""[1] Ratio of the errors after and before two steps above which a posture leads to none that is
exact. Where three meet, every other step makes the error larger."""

ERROR_WEIGHT: Final = 0.01
"""[1] Damping of a step, relative to the squared error."""

DAMPING: Final = 1e-15
"""[1] Damping of a step at an exact posture, which keeps a singular matrix solvable."""


class Refined(NamedTuple):
    """Postures after the steps.

    Attributes:
        q: (N, n) joint angles [rad].
        error: (N,) angle [rad] or distance [m] from the tool to the pose, the larger number.
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
    best = Refined(np.array(q), _size(error), np.array(J))
    active = np.flatnonzero((best.error > DOUBLE) & (best.error <= within))
    now, error, J = q[active], error[active], J[active]
    previous, size = np.full(len(active), np.inf), best.error[active]
    for _ in range(STEPS):
        if not len(active):
            break
        J[:, :, list(locked)] = 0.0
        transposed = J.swapaxes(1, 2)
        A = transposed @ J
        square = np.einsum("ni,ni->n", error, error)
        A.reshape(len(A), -1)[:, :: chain.n + 1] += ERROR_WEIGHT * square[:, None] + DAMPING
        now = now + np.linalg.solve(A, transposed @ error[:, :, None])[:, :, 0]
        error, J = _looked(chain, now, T[active])
        limit, previous, size = GAIN * previous, size, _size(error)
        is_better = size < best.error[active]
        places = active[is_better]
        best.q[places], best.error[places] = now[is_better], size[is_better]
        best.J[places] = J[is_better]
        continues = (size < limit) & (size > DOUBLE)
        active, previous, size = active[continues], previous[continues], size[continues]
        now, error, J = now[continues], error[continues], J[continues]
    return best


def _size(error: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(error.reshape(-1, 2, 3), axis=2).max(axis=1, initial=0.0))


def _looked(chain: Chain, q: FloatArray, T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return error (N, 6) and Jacobian (N, 6, n) of postures, in the frame of the tool."""
    reached, J = jacobian_batch(chain, q)
    inverse = reached[:, :3, :3].swapaxes(1, 2)
    left = inverse @ T[:, :3, :3]
    error = np.empty((len(q), 6))
    error[:, 0] = 0.5 * (left[:, 2, 1] - left[:, 1, 2])
    error[:, 1] = 0.5 * (left[:, 0, 2] - left[:, 2, 0])
    error[:, 2] = 0.5 * (left[:, 1, 0] - left[:, 0, 1])
    error[:, 3:] = (inverse @ (T[:, :3, 3:] - reached[:, :3, 3:]))[:, :, 0]
    return error, J
