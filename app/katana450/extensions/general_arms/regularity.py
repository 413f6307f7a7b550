"""The distance of a posture from the edge of its branch, for arms of any number of axes.

The matrix that decides has as many rows as the tool has freedoms that the arm can choose: all six
from six axes on, and with n < 6 axes the tool point and the turns about the last n - 3 axes. A
branch ends where it loses rank. With the swivel of seven axes locked, the other six decide, because
they define the branches.

Weyl's inequality keeps a step on its branch: the smallest singular value changes by at most the
norm of the change of the matrix. A step that changes it by less never passes a singular posture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray

WALL: Final = 0.02
"""[1] Smallest singular value below which a motion without a closed form leads no farther."""


SINGULAR: Final = 1e-9
"""[1] Smallest singular value that is only rounding."""

NEAR: Final = 0.1
"""[1] Smallest singular value from which on a step need not regard the edge."""


@dataclass(frozen=True)
class Regularity:
    """The matrix of a chain with ``n`` axes; ``swivel`` is the index of a locked joint, or None."""

    n: int
    swivel: int | None = None

    @cached_property
    def _others(self) -> list[int]:
        return [k for k in range(self.n) if k != self.swivel]

    def matrix(self, J: FloatArray) -> FloatArray:
        """Return the matrix for the Jacobian `J` (6, n), whose translations are over a length."""
        if self.swivel is not None:
            return J.take(self._others, axis=-1)
        if self.n >= 6:
            return J
        turns = J[:3, min(3, self.n) :]
        return np.concatenate((turns.T @ J[:3], J[3:]))

    @staticmethod
    def least(matrix: FloatArray) -> float:
        """Return the smallest singular value of a matrix."""
        return float(np.linalg.svd(matrix, compute_uv=False)[-1])

    @staticmethod
    def allows(least: float, before: FloatArray, least_after: float, after: FloatArray) -> bool:
        """Return whether a step between two matrices stays on the branch, clear of its edge.

        Beyond WALL, where an arm may stand, steps lead only back, on the same side of the edge.
        """
        if least >= WALL:
            return least_after >= WALL and float(np.linalg.norm(after - before)) < least
        if least_after < least:
            return False
        rows, columns = before.shape
        if rows != columns or least < SINGULAR:
            return True
        return float(np.linalg.det(before) * np.linalg.det(after)) > 0.0
