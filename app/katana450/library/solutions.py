"""All solutions of the inverse kinematics for one pose or for many."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.errors import InputError
from katana450.extensions.batch.inverse_batch import inverse_batch
from katana450.extensions.general_arms.closed_form import ClosedForm, errors_of, validated_poses
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse import inverse
from katana450.maths.kinematics.kinematics import Kinematics, SolvedPosture


@dataclass(frozen=True, eq=False)
class IKSolutions:
    """The solutions of a pose, one for each branch, in the order of `branches`.

    For N poses every array has a leading dimension N. The solutions of a single pose can be
    iterated over, as in ``for solution in arm.ik(T)``. Each has ``q``, ``branch``,
    ``within_limits``, ``position_error``, ``rotation_error`` and ``exact``.

    Attributes:
        q: (k, n) or (N, k, n) joint angles [rad].
        within_limits: (k,) or (N, k) whether every joint is inside its limits.
        position_error: (k,) or (N, k) distance between the target and the pose that forward
            kinematics gives for ``q`` [m].
        rotation_error: (k,) or (N, k) angle between the same two poses [rad].
        branches: the k branches: of a five-axis arm `Branch`, of others their names.
    """

    q: FloatArray
    within_limits: npt.NDArray[np.bool_]
    position_error: FloatArray
    rotation_error: FloatArray
    branches: tuple[Branch | str, ...] = BRANCHES
    _single: tuple[SolvedPosture, ...] | None = None

    @staticmethod
    def of_pose(chain: Chain, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> IKSolutions:
        """Solve the pose ``T`` (4, 4) in {S}; errors as in `maths.kinematics.inverse.inverse`."""
        found = tuple(inverse(chain, T, q_hint=q_hint))
        return IKSolutions(
            q=np.array([each.q for each in found]),
            within_limits=np.array([each.within_limits for each in found]),
            position_error=np.array([each.position_error for each in found]),
            rotation_error=np.array([each.rotation_error for each in found]),
            _single=found,
        )

    @staticmethod
    def of_poses(chain: Chain, T: npt.ArrayLike) -> IKSolutions:
        """Solve the poses ``T`` (N, 4, 4) in {S}; errors as in `inverse_batch`."""
        found = inverse_batch(chain, T, residuals=True)
        assert found.position_error is not None
        assert found.rotation_error is not None
        return IKSolutions(found.q, found.within_limits, found.position_error, found.rotation_error)

    @staticmethod
    def of_one(
        kinematics: Kinematics, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None
    ) -> IKSolutions:
        """Solve the pose ``T`` (4, 4) in {S} of any arm; errors as in `Kinematics.inverse`."""
        found = tuple(kinematics.inverse(T, q_hint))
        return IKSolutions(
            q=np.array([each.q for each in found]),
            within_limits=np.array([each.within_limits for each in found]),
            position_error=np.array([each.position_error for each in found]),
            rotation_error=np.array([each.rotation_error for each in found]),
            branches=tuple(str(each.branch) for each in found),
            _single=found,
        )

    @staticmethod
    def of_many(kinematics: Kinematics, T: npt.ArrayLike) -> IKSolutions:
        """Solve the poses ``T`` (N, 4, 4) in {S} of any arm; errors as in `of_one`."""
        chain, poses = kinematics.chain, validated_poses(T)
        if isinstance(kinematics, ClosedForm):
            q, branches = kinematics.inverse_batch(poses), kinematics.branches
        else:
            found = [kinematics.inverse(each) for each in poses]
            branches = tuple(str(each.branch) for each in found[0]) if found else ()
            q = np.array([[each.q for each in some] for some in found])
            q = q.reshape(len(found), len(branches), chain.n)
        slack = tolerances.LIMIT_SLACK
        inside = np.asarray(
            ((q >= chain.lower - slack) & (q <= chain.upper + slack)).all(axis=-1), dtype=np.bool_
        )
        return IKSolutions(q, inside, *errors_of(chain, q, poses), branches=branches)

    @property
    def feasible(self) -> tuple[SolvedPosture, ...]:
        """Solutions of a single pose that reach it exactly and are inside the joint limits."""
        return tuple(each for each in self if each.exact and each.within_limits)

    def __iter__(self) -> Iterator[SolvedPosture]:
        """Iterate over the solutions of a single pose. Raises InputError for several poses."""
        if self._single is None:
            raise InputError(
                f"These are the solutions of {len(self.q)} poses. Index the arrays, for example "
                "`.q[pose, branch]`, or solve one pose at a time."
            )
        return iter(self._single)
