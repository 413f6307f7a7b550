"""The interface of inverse kinematics, whichever method computes them."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
import numpy.typing as npt

from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.branch import BRANCHES, AnyBranch, Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.inverse_batch import inverse_batch, validated_poses
from katana450.maths.kinematics.solution import Solutions
from katana450.maths.kinematics.solver import inverse
from katana450.maths.kinematics.turns import near_turns

CHECKED: Final = 8
"""Number of postures whose poses an arm solves when it is read."""


@dataclass(frozen=True, eq=False)
class Kinematics(ABC):
    """Inverse kinematics of one chain.

    Attributes:
        chain: the chain, whose `M` is the pose of the tool.
        is_pitched: whether the tool has a pitch and a roll of its own, but no rotation: five axes.
        is_exact: whether each branch has one posture for every pose, in closed form.
        are_separate: whether no motion leads from one branch to another without a singularity.
        arm_angle_joint: index of the joint that sets the arm angle of seven axes; None without one.
        file_offset: a bound [m], [rad] on the difference between the tools of the arm in the file
            and of the arm with exact axes that is solved; None if the arm in the file is solved.
    """

    chain: Chain

    is_pitched: ClassVar[bool] = False
    are_separate: ClassVar[bool] = True

    @property
    def is_exact(self) -> bool:  # noqa: D102
        return False

    @property
    def arm_angle_joint(self) -> int | None:  # noqa: D102
        return None

    @property
    def file_offset(self) -> float | None:  # noqa: D102
        return None

    @property
    @abstractmethod
    def method(self) -> str:
        """The method in a few words, for people."""

    @property
    @abstractmethod
    def branches(self) -> tuple[AnyBranch, ...]:
        """The branches, in the order of the solutions."""

    @abstractmethod
    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return a solution for each branch of the pose `T` (4, 4) = T_S_tool [m].

        `q_hint` (n,) [rad] decides what the pose leaves free. Raises InputError for an invalid `T`
        or `q_hint`.
        """

    @cached_property
    def self_check(self) -> tuple[str, ...]:
        """Sentences on poses of the arm itself that are not solved; none if all are.

        The poses are those of CHECKED postures inside the limits.
        """
        chain, rng = self.chain, np.random.default_rng(CHECKED)
        q = rng.uniform(chain.lower, chain.upper, (CHECKED, chain.n))
        solved = [any(x.exact for x in self.inverse(T)) for T in forward_batch(chain, q)]
        note = (
            f"{CHECKED - sum(solved)} of {CHECKED} poses of the arm itself are not solved: a pose "
            "that is missed may be one that the arm can take."
        )
        return () if all(solved) else (note,)

    def inverse_batch(self, T: npt.ArrayLike) -> FloatArray:
        """Return the joint angles (N, branches, n) [rad] of poses `T` (N, 4, 4) [m], as `inverse`.

        Raises InputError for the first invalid pose.
        """
        q = [[solution.q for solution in self.inverse(pose)] for pose in validated_poses(T)]
        return np.array(q).reshape(len(q), len(self.branches), self.chain.n)

    def at_arm_angles(self, T: FloatArray, arm_angles: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return `inverse_batch` of poses `T` (N, 4, 4), each with an arm angle of ``arm_angles``.

        ``arm_angles`` (N,) [rad] are those of `arm_angle_joint`; they do not count without one.
        """
        return self.inverse_batch(T)

    def postures(self, T: FloatArray, near: FloatArray) -> FloatArray | None:
        """Return the posture (k, n) [rad] of each branch for the pose `T` (4, 4), near ``near``.

        None for a search. A posture may miss the pose, and be beyond the limits; its angles are not
        numbers where the branch has none.
        """
        return np.array([solution.q for solution in self.inverse(T, near)])

    def at_arm_angle_of(self, T: FloatArray, near: FloatArray) -> FloatArray | None:
        """Return `postures` (N, k, n) for poses (N, 4, 4), with the arm angle of ``near`` (n,)."""
        postures = [posture for pose in T if (posture := self.postures(pose, near)) is not None]
        return np.array(postures) if postures else None

    def branch_of(self, q: FloatArray) -> AnyBranch:
        """Return the branch of the joint angles `q` (n,) [rad]."""
        postures = self.at_arm_angle_of(forward(self.chain, q)[None], q)
        if postures is None:
            return self.branches[0]
        turns = postures[0] - q
        turns -= math.tau * np.round(turns / math.tau)
        return self.branches[int(np.nan_to_num(np.abs(turns), nan=math.inf).max(axis=1).argmin())]

    def on_branch(self, T: FloatArray, branch: AnyBranch, near: FloatArray) -> FloatArray | None:
        """Return the joint angles (n,) [rad] of ``branch`` for the pose `T` (4, 4), near ``near``.

        Each angle is in the turn nearest to ``near`` that is inside its limits. None for a search.
        The posture may miss the pose, and be beyond the limits.
        """
        postures = self.postures(T, near)
        if postures is None:
            return None
        q = postures[self.branches.index(branch)]
        return near_turns(self.chain, q, near) if np.isfinite(q).all() else None


@dataclass(frozen=True, eq=False)
class FiveAxisKinematics(Kinematics):
    """The closed form of the five-axis family behind the interface."""

    method: ClassVar[str] = "closed form for five axes: pan, three parallel axes, roll"
    branches: ClassVar[tuple[AnyBranch, ...]] = BRANCHES
    is_pitched: ClassVar[bool] = True

    def branch_of(self, q: FloatArray) -> Branch:
        """Return `branch.branch_of`."""
        return branch_of(self.chain, q)

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return `inverse.inverse`."""
        return inverse(self.chain, T, q_hint=q_hint)

    def inverse_batch(self, T: npt.ArrayLike) -> FloatArray:
        """Return `inverse_batch.inverse_batch`."""
        return inverse_batch(self.chain, T)
