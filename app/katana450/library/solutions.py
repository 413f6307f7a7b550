"""All solutions of the inverse kinematics for one pose or for many."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.caching import cached_property
from katana450.errors import InputError
from katana450.extensions.batch.inverse_batch import inverse_batch
from katana450.extensions.general_arms.closed_form import ClosedForm, errors_of, validated_poses
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse import inverse
from katana450.maths.kinematics.kinematics import Kinematics, SolvedPosture
from katana450.maths.kinematics.pose_units import check_metres

Branches = tuple[Branch | str, ...]

ROUNDING_ERRORS: Final = 10.0
"""[m], [rad] Error of a solution, relative to the misfit of its pose, that rounding explains."""


class IKSolutions:
    """The solutions of a pose, one for each branch, in the order of `branches`.

    For N poses every array has a leading dimension N. The solutions of a single pose can be
    iterated over, as in ``for solution in arm.ik(T)``. Each has ``q``, ``branch``,
    ``within_limits``, ``position_error``, ``rotation_error`` and ``exact``.
    """

    # Of a single pose, all that follows from the postures is computed when it is first read.
    def __init__(
        self, chain: Chain, T: FloatArray, postures: Sequence[SolvedPosture] | None = None
    ) -> None:
        """Hold the ``postures`` of the pose `T` (4, 4) in {S}; None for N poses.

        Raises InputError for a pose whose unit is in doubt.
        """
        self._chain = chain
        self._T = T
        self._postures = postures
        if postures is not None:
            check_metres(chain, T[:3, 3].tolist())
        elif len(T):
            distances = np.linalg.norm(T[:, :3, 3], axis=1)
            number = int(distances.argmax())
            check_metres(chain, T[number, :3, 3].tolist(), f"Pose {number}")

    @staticmethod
    def of_pose(chain: Chain, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> IKSolutions:
        """Solve the pose ``T`` (4, 4) in {S}; errors as in `maths.kinematics.inverse.inverse`."""
        postures = inverse(chain, T, q_hint=q_hint)
        solutions = IKSolutions(chain, np.array(T), postures)
        solutions.branches = BRANCHES
        return solutions

    @staticmethod
    def of_poses(chain: Chain, T: npt.ArrayLike) -> IKSolutions:
        """Solve the poses ``T`` (N, 4, 4) in {S}; errors as in `inverse_batch`."""
        found = inverse_batch(chain, T, residuals=True)
        assert found.position_error is not None
        assert found.rotation_error is not None
        solutions = IKSolutions(chain, np.array(T))
        solutions.q, solutions.branches = found.q, BRANCHES
        solutions._errors = found.position_error, found.rotation_error
        return solutions

    @staticmethod
    def of_one(
        kinematics: Kinematics, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None
    ) -> IKSolutions:
        """Solve the pose ``T`` (4, 4) in {S} of any arm; errors as in `Kinematics.inverse`."""
        return IKSolutions(kinematics.chain, np.array(T), kinematics.inverse(T, q_hint))

    @staticmethod
    def of_many(kinematics: Kinematics, T: npt.ArrayLike) -> IKSolutions:
        """Solve the poses ``T`` (N, 4, 4) in {S} of any arm; errors as in `of_one`."""
        chain, poses = kinematics.chain, validated_poses(T)
        solutions = IKSolutions(chain, np.array(T).reshape(-1, 4, 4))
        if isinstance(kinematics, ClosedForm):
            solutions.q, solutions.branches = kinematics.inverse_batch(poses), kinematics.branches
        else:
            found = [kinematics.inverse(each) for each in poses]
            branches = tuple(str(each.branch) for each in found[0]) if found else ()
            q = np.array([[each.q for each in some] for some in found])
            solutions.q = q.reshape(len(found), len(branches), chain.n)
            solutions.branches = branches
        solutions._errors = errors_of(chain, solutions.q, poses)
        return solutions

    @cached_property
    def q(self) -> FloatArray:
        """(k, n) or (N, k, n) joint angles [rad]."""
        return np.array([each.q for each in self])

    @cached_property
    def branches(self) -> Branches:
        """The k branches: of a five-axis arm `Branch`, of others their names."""
        return tuple(str(each.branch) for each in self)

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
        errors = np.array([(each.position_error, each.rotation_error) for each in self])
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
    def feasible(self) -> tuple[SolvedPosture, ...]:
        """Solutions of a single pose that reach it and are inside the joint limits.

        They reach it exactly, or to within the rounding of its numbers.
        """
        slack = ROUNDING_ERRORS * self.rotation_misfit
        return tuple(
            each
            for each in self
            if each.within_limits
            and (each.exact or max(each.position_error, each.rotation_error) <= slack)
        )

    def __iter__(self) -> Iterator[SolvedPosture]:
        """Iterate over the solutions of a single pose. Raises InputError for several poses."""
        if self._postures is None:
            raise InputError(
                f"These are the solutions of {len(self.q)} poses. Index the arrays, for example "
                "`.q[pose, branch]`, or solve one pose at a time."
            )
        return iter(self._postures)
