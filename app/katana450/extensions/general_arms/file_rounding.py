"""Solutions of an arm whose file rounds angles and lengths that a closed form takes as exact.

A closed form solves the exact arm. The tool of the arm in the file is beside it by little more than
the rounding, which the steps of refinement.py take away. Four axes cannot take every pose: their
closed form is asked again for the tool point that is moved back by the difference, at most
CORRECTIONS times, and only while more than DOUBLE is left.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.general_arms.links import DOUBLE, DHLinks
from katana450.extensions.general_arms.refinement import refined
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.turns import in_limits_turns

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
