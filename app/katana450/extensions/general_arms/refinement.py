"""Refinement of postures on the chain as its file describes it, many at once.

A step of Newton's method solves (J'J + |e|^2 / 100) dq = J'e, where e is the twist from the tool to
the pose and J the Jacobian, both in the frame of the tool. With this damping the error also falls
quadratically at postures without a regular Jacobian (Yamashita and Fukushima 2001), where two
solutions meet.

A closed form solves the exact arm, without the rounding of its file. The tool of the arm in the
file is beside it by little more than the rounding, which these steps take away. Four axes cannot
take every pose: their closed form is asked again for the tool point that is moved back by the
difference, at most CORRECTIONS times, and only while more than DOUBLE is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.general_arms.links import DOUBLE, DHLinks
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch, jacobian_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.turns import in_limits_turns

STEPS: Final = 20
"""Maximum number of steps."""

ENOUGH: Final = 1e-14
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
    active = np.flatnonzero((best.error > ENOUGH) & (best.error <= within))
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
        continues = (size < limit) & (size > ENOUGH)
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


CORRECTIONS: Final = 2

BESIDE: Final = 10.0
"""[1] Ratio of a miss to the bound `FileRounding.offset`, above which the pose is out of reach."""


@dataclass(frozen=True, eq=False)
class FileRounding:
    """The difference between the arm ``chain`` of a file and the exact ``links`` that solve it."""

    chain: Chain
    links: DHLinks

    @cached_property
    def offset(self) -> float:
        """A bound [m], [rad] on the difference of the tool's poses."""
        angle, length = self.links.rounding
        return self.links.n * (angle * max(1.0, self.links.reach) + length)

    @cached_property
    def is_corrected(self) -> bool:
        """True if the file rounds more than double precision does."""
        return max(self.links.rounding) > DOUBLE

    @cached_property
    def slack(self) -> float:
        """The error [m], [rad] that a solution for a pose of the exact arm cannot avoid.

        Four axes that are not quite parallel take few poses exactly, and none in two postures. Near
        axis 1 the turn of axis 1 magnifies the rounding, and a posture may count as not exact.
        """
        return BESIDE * self.offset if self.is_corrected and self.chain.n == 4 else 0.0

    def corrected(
        self,
        q: FloatArray,
        T: FloatArray,
        solve: Callable[[FloatArray], FloatArray] | None = None,
        locked: tuple[int, ...] = (),
    ) -> FloatArray:
        """Return `q` (N, n) [rad] of the exact arm as joint angles of the arm in the file.

        Postures that miss the pose by more than the rounding explains are out of reach, and stay.

        Args:
            q: the postures.
            T: (N, 4, 4) their poses.
            solve: returns the exact arm's postures (N, 4) for other poses, of four axes.
            locked: joints that stay.
        """
        if not self.is_corrected:
            return q
        within = BESIDE * self.offset
        if solve is None:
            return in_limits_turns(self.chain, refined(self.chain, q, T, within, locked).q)
        # Four axes hold the tool point of every pose, and the rotation as far as they can.
        aimed = T
        for _ in range(CORRECTIONS):
            missed = T[:, :3, 3] - forward_batch(self.chain, q)[:, :3, 3]
            near = np.linalg.norm(missed, axis=1) <= within
            if not (np.abs(missed[near]) > DOUBLE).any():
                return q
            aimed = aimed.copy()
            aimed[:, :3, 3] += missed
            q = np.where(near[:, None], solve(aimed), q)
        return q
