"""Solutions of an arm whose file rounds angles and lengths that a closed form takes as exact.

A closed form solves the exact arm. The tool of the arm in the file is beside it by little more than
the rounding. The closed form is asked again for the pose that is moved back by this difference, at
most CORRECTIONS times, and only while more than DOUBLE is left; each time the error becomes smaller
by the size of the rounding, divided by the distance of the posture from a singularity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.general_arms.links import DOUBLE, DHLinks
from katana450.extensions.general_arms.numerical import search_of
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.turns import in_limits_turns

CORRECTIONS: Final = 2

STEPS: Final = 8
"""Maximum number of steps of a posture near a singularity."""

EXACT: Final = 1e-11
"""[m], [1] Difference from a pose that needs no further step."""

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
        self, q: FloatArray, T: FloatArray, solve: Callable[[FloatArray], FloatArray]
    ) -> FloatArray:
        """Return `q` (N, n) [rad] of the exact arm as joint angles of the arm in the file.

        `T` (N, 4, 4) are the poses; ``solve`` returns the exact arm's (N, n) for others. Postures
        that miss the pose by more than the rounding explains are out of reach, and stay.
        """
        if not self.is_corrected:
            return q
        aimed = T
        for _ in range(CORRECTIONS):
            reached = forward_batch(self.chain, q)
            missed = T[:, :3, 3] - reached[:, :3, 3]
            near = np.linalg.norm(missed, axis=1) <= BESIDE * self.offset
            left = missed if self.chain.n == 4 else T - reached
            if not (np.abs(left[near]) > DOUBLE).any():
                return q
            if self.chain.n == 4:
                # They hold the tool point of every pose, and the rotation as far as they can.
                aimed = aimed.copy()
                aimed[:, :3, 3] += missed
            else:
                aimed = aimed @ np.linalg.solve(reached, T)
            q = np.where(near[:, None], solve(aimed), q)
        return q if self.chain.n == 4 else self._polished(q, T)

    def _polished(self, q: FloatArray, T: FloatArray) -> FloatArray:
        """Return `q` (N, n) [rad] after Gauss-Newton steps where the corrections did not converge.

        These are postures whose distance from a singularity is little more than the rounding.
        """
        q, chain = np.array(q), self.chain
        missed = np.abs(forward_batch(chain, q) - T).max(axis=(1, 2))
        for k in np.flatnonzero((missed > EXACT) & (missed <= BESIDE * self.offset)).tolist():
            angles, _ = search_of(self.chain).descend(
                search_of(self.chain).goal(T[k]), q[k].tolist(), STEPS
            )
            if np.abs(forward(chain, angles) - T[k]).max() < missed[k]:
                q[k] = in_limits_turns(chain, np.array(angles))
        return q
