"""All solutions of the inverse kinematics for one pose or for many."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.library.pose_frame import dimensions
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import errors_of
from katana450.maths.kinematics.inverse_batch import validated_poses
from katana450.maths.kinematics.kinematics import Kinematics
from katana450.maths.kinematics.pose import check_metres
from katana450.maths.kinematics.solution import Solution, Solutions

ROUNDING_ERRORS: Final = 10.0
"""[m], [rad] Error of a solution, relative to the misfit of its pose, that rounding explains."""


class IKSolutions:
    """The solutions of a pose, one for each branch, in the order of `branches`.

    For N poses every array has a leading dimension N. The solutions of a single pose can be
    iterated over, as in ``for solution in arm.ik(T)``. Each has ``q``, ``branch``,
    ``within_limits``, ``position_error``, ``rotation_error`` and ``exact``.
    """

    # All that follows from the solutions is computed when it is first read.
    def __init__(
        self, kinematics: Kinematics, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None
    ) -> None:
        """Solve the pose `T` (4, 4) in {S}, or, without a hint, poses (N, 4, 4).

        Errors are those of `Kinematics`, and InputError for a pose whose unit is in doubt.
        """
        self._chain = chain = kinematics.chain
        self.branches = kinematics.branches
        self._solutions: Solutions | None = None
        if q_hint is None and dimensions(T) == 3:
            self.q = kinematics.inverse_batch(T)
            self._T = np.array(T).reshape(-1, 4, 4)
            if len(self._T):
                number = int(np.linalg.norm(self._T[:, :3, 3], axis=1).argmax())
                check_metres(chain, self._T[number, :3, 3].tolist(), f"Pose {number}")
        else:
            self._solutions = kinematics.inverse(T, q_hint)
            self._T = np.array(T)
            check_metres(chain, self._T[:3, 3].tolist())

    @cached_property
    def q(self) -> FloatArray:
        """(k, n) or (N, k, n) joint angles [rad]."""
        return np.array([solution.q for solution in self])

    @cached_property
    def within_limits(self) -> npt.NDArray[np.bool_]:
        """(k,) or (N, k) whether every joint is inside its limits."""
        slack, q = tolerances.LIMIT_SLACK, self.q
        inside = (q >= self._chain.lower - slack) & (q <= self._chain.upper + slack)
        return np.asarray(inside.all(axis=-1), dtype=np.bool_)

    @property
    def position_error(self) -> FloatArray:
        """(k,) or (N, k) distance [m] between target and forward kinematics of ``q``."""
        return self._errors[0]

    @property
    def rotation_error(self) -> FloatArray:
        """(k,) or (N, k) angle [rad] between the same two poses."""
        return self._errors[1]

    @cached_property
    def _errors(self) -> tuple[FloatArray, FloatArray]:
        if self._solutions is None:
            return errors_of(self._chain, self.q, validated_poses(self._T))
        errors = np.array([(solution.position_error, solution.rotation_error) for solution in self])
        return errors[:, 0], errors[:, 1]

    @property
    def rotation_misfit(self) -> float | FloatArray:
        """Largest entry of R^T R - I of the pose as it was given, or (N,) of N poses.

        Its nearest rotation is solved. Rounding to four decimals gives up to 1.8e-4.
        """
        R = self._T[..., :3, :3]
        misfit = np.abs(R.swapaxes(-1, -2) @ R - np.eye(3)).max(axis=(-2, -1))
        return misfit if misfit.ndim else float(misfit)

    @property
    def feasible(self) -> tuple[Solution, ...]:
        """Solutions of a single pose that reach it and are inside the joint limits.

        They reach it exactly, or to within the rounding of its numbers.
        """
        slack = ROUNDING_ERRORS * self.rotation_misfit
        return tuple(
            solution
            for solution in self
            if solution.within_limits
            and (solution.exact or max(solution.position_error, solution.rotation_error) <= slack)
        )

    def __iter__(self) -> Iterator[Solution]:
        """Iterate over the solutions of a single pose. Raises InputError for several poses."""
        if self._solutions is None:
            raise InputError(
                f"These are the solutions of {len(self.q)} poses. Index the arrays, for example "
                "`.q[pose, branch]`, or solve one pose at a time."
            )
        return iter(self._solutions)
