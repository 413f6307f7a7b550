"""A test of many poses at once, for arms outside the five-axis family."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.numerical import Numerical
from katana450.extensions.general_arms.swivel import SevenAxes
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import errors_of
from katana450.maths.kinematics.chain import Chain

BoolArray = npt.NDArray[np.bool]

Solver = ClosedForm | SevenAxes | Numerical
"""The kinematics of arms outside the five-axis family."""

SWIVELS: Final = 16
"""Number of angles of the swivel of seven axes that are tried for a pose."""

SEEDS: Final = 6
"""Number of postures from which a numerical search for a pose begins."""


@dataclass(frozen=True, eq=False)
class PoseSolver:
    """The test of one arm.

    Attributes:
        solver: its kinematics.
        accepts: returns (N,) whether postures (N, n) [rad] inside the limits may be taken.
    """

    solver: Solver
    accepts: Callable[[FloatArray], BoolArray]

    @property
    def chain(self) -> Chain:
        """The chain."""
        return self.solver.chain

    def taken(self, T: FloatArray) -> BoolArray:
        """Return (N,) whether a posture inside the limits takes the pose, for `T` (N, 4, 4)."""
        match self.solver:
            case ClosedForm():
                return self._exact(self.solver.solve_batch(T), T)
            case SevenAxes():
                return self._with_swivel(self.solver, T)
            case Numerical():
                return self._searched(self.solver, T)

    def _with_swivel(self, solver: SevenAxes, T: FloatArray) -> BoolArray:
        low, high = self.chain.lower[solver.swivel], self.chain.upper[solver.swivel]
        step = (high - low) / SWIVELS
        swivels = np.linspace(low + 0.5 * step, high - 0.5 * step, SWIVELS)
        taken = np.zeros(len(T), dtype=np.bool)
        # Those in the middle take the most poses, which the others need not try.
        for swivel in swivels[np.argsort(np.abs(swivels - 0.5 * (low + high)), kind="stable")]:
            left = np.flatnonzero(~taken)
            q = solver.at_swivels(T[left], np.full(len(left), swivel))
            taken[left] = self._exact(q, T[left])
        return taken

    def _searched(self, solver: Numerical, T: FloatArray) -> BoolArray:
        taken = np.zeros(len(T), dtype=np.bool)
        hint = None
        for number, pose in enumerate(T):
            q = np.array(solver.solve(pose, hint, SEEDS))
            taken[number] = self._exact(q[None, None], pose[None])[0]
            # The next pose is often near this one.
            hint = q if taken[number] else None
        return taken

    def _exact(self, q: FloatArray, T: FloatArray) -> BoolArray:
        """Return (N,) whether one of `q` (N, k, n) is inside the limits and takes `T` (N, 4, 4)."""
        chain, slack = self.chain, tolerances.LIMIT_SLACK
        inside = ((q >= chain.lower - slack) & (q <= chain.upper + slack)).all(axis=-1)
        pose, branch = np.nonzero(inside)
        chosen = q[pose, branch]
        # Postures for a pose out of reach are only near it.
        distance, turn = errors_of(chain, chosen[:, None], T[pose])
        # The swivels are solved for the exact arm, beside which the file describes this one.
        off = 0.0 if isinstance(self.solver, Numerical) else self.solver.rounding.offset
        exact = (distance <= tolerances.SAME_POSITION + off) & (
            turn <= tolerances.SAME_ROTATION + off
        )
        good = exact[:, 0] & self.accepts(chosen)
        taken = np.zeros(len(T), dtype=np.bool)
        taken[pose[good]] = True
        return taken
