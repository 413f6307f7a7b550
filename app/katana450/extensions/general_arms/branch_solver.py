"""The branches of an arm: their names, the branch of a posture, and a posture on each branch."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from katana450 import tolerances
from katana450.extensions.general_arms.branch_words import SECOND
from katana450.extensions.general_arms.closed_form import ClosedForm
from katana450.extensions.general_arms.swivel import SevenAxes
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.kinematics import Kinematics


@dataclass(frozen=True, eq=False)
class BranchSolver:
    """The branches that the kinematics ``solver`` of one chain distinguish."""

    solver: Kinematics

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in the order of the solutions."""
        return tuple(map(str, self.solver.branches))

    @property
    def shown(self) -> tuple[str, ...]:
        """The names in the order for people: those of usual postures first."""
        second = {name: [word in SECOND for word in name.split("-")] for name in self.names}
        return tuple(sorted(self.names, key=second.__getitem__))

    @property
    def swivel(self) -> int | None:
        """Index of the joint that is the parameter of seven axes; None without one."""
        return self.solver.swivel if isinstance(self.solver, SevenAxes) else None

    @property
    def is_exact(self) -> bool:
        """True if each branch has one posture for every pose, in closed form."""
        return isinstance(self.solver, ClosedForm) and self.solver.chain.n == 6

    def branch_of(self, q: FloatArray) -> str:
        """Return the name of the branch of the joint angles `q` (n,) [rad]."""
        solver = self.solver
        if isinstance(solver, ClosedForm):
            found = np.array(solver.solve(forward(solver.chain, q), q.tolist()))
        elif isinstance(solver, SevenAxes):
            swivel = q[solver.swivel : solver.swivel + 1]
            found = solver.at_swivels(forward(solver.chain, q), swivel)[0]
        else:
            return self.names[0]
        away = found - q
        away -= math.tau * np.round(away / math.tau)
        return self.names[int(np.nan_to_num(np.abs(away), nan=math.inf).max(axis=1).argmin())]

    def on_branch(self, T: FloatArray, branch: str, near: FloatArray) -> FloatArray | None:
        """Return the joint angles (n,) [rad] of ``branch`` for the pose `T` (4, 4), near ``near``.

        Each angle is in the turn nearest to ``near`` that is inside its limits. None for an arm
        without a closed form. The posture may miss the pose, and be beyond the limits.
        """
        solver = self.solver
        if isinstance(solver, ClosedForm):
            found = np.array(solver.solve(T, near.tolist()))
        elif isinstance(solver, SevenAxes):
            found = solver.best(T, near)
        else:
            return None
        q = found[self.names.index(branch)]
        return near_turns(solver.chain, q, near) if np.isfinite(q).all() else None

    def at_its_swivel(self, T: FloatArray, branch: str, near: FloatArray) -> FloatArray:
        """Return the joint angles (N, 7) [rad] of ``branch`` for poses `T` (N, 4, 4).

        The swivel is that of ``near`` (7,). The postures may miss the poses and be beyond the
        limits; angles are not numbers where the branch has none.
        """
        solver = self.solver
        assert isinstance(solver, SevenAxes)
        swivels = np.full(len(T), near[solver.swivel])
        found: FloatArray = solver.at_swivels(T, swivels)[:, self.names.index(branch)]
        return found


def near_turns(chain: Chain, q: FloatArray, near: FloatArray) -> FloatArray:
    """Return `q` (n,) [rad], each angle in the turn nearest to ``near`` inside its limits."""
    q = q + math.tau * np.round((near - q) / math.tau)
    slack = tolerances.LIMIT_SLACK
    for turn in (math.tau, -math.tau):
        outside = (q < chain.lower - slack) | (q > chain.upper + slack)
        other = q + turn
        fits = outside & (other >= chain.lower - slack) & (other <= chain.upper + slack)
        q = np.where(fits, other, q)
    return q
