"""The interface of the kinematics of arms outside the five-axis family, with their branches."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from katana450 import tolerances
from katana450.extensions.general_arms.branch_words import ORDINALS, SECOND
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.kinematics import Kinematics


@dataclass(frozen=True, eq=False)
class GeneralKinematics(Kinematics):
    """The `Kinematics` of one chain that also tell its branches apart."""

    @property
    @abstractmethod
    def branches(self) -> tuple[str, ...]:
        """The names of the branches, in the order of the solutions."""

    @property
    def arm_angle_joint(self) -> int | None:
        """Index of the joint that is the parameter of seven axes; None without one."""
        return None

    @property
    def is_exact(self) -> bool:
        """True if each branch has one posture for every pose, in closed form."""
        return False

    @property
    def are_separate(self) -> bool:
        """True if no motion leads from one branch to another without a singularity."""
        return True

    def postures(self, T: FloatArray, near: FloatArray) -> FloatArray | None:  # noqa: ARG002
        """Return the posture (k, n) [rad] of each branch for the pose `T` (4, 4), near ``near``.

        None without a closed form. A posture may miss the pose, and be beyond the limits; its
        angles are not numbers where the branch has none.
        """
        return None

    def at_arm_angle_of(self, T: FloatArray, near: FloatArray) -> FloatArray | None:
        """Return `postures` (N, k, n) for poses (N, 4, 4), with the arm angle of ``near`` (n,)."""
        postures = [posture for pose in T if (posture := self.postures(pose, near)) is not None]
        return np.array(postures) if postures else None

    def branch_of(self, q: FloatArray) -> str:
        """Return the name of the branch of the joint angles `q` (n,) [rad]."""
        postures = self.at_arm_angle_of(forward(self.chain, q)[None], q)
        if postures is None:
            return self.branches[0]
        turns = postures[0] - q
        turns -= math.tau * np.round(turns / math.tau)
        return self.branches[int(np.nan_to_num(np.abs(turns), nan=math.inf).max(axis=1).argmin())]

    def on_branch(self, T: FloatArray, branch: str, near: FloatArray) -> FloatArray | None:
        """Return the joint angles (n,) [rad] of ``branch`` for the pose `T` (4, 4), near ``near``.

        Each angle is in the turn nearest to ``near`` that is inside its limits. None for an arm
        without a closed form. The posture may miss the pose, and be beyond the limits.
        """
        postures = self.postures(T, near)
        if postures is None:
            return None
        q = postures[self.branches.index(branch)]
        return near_turns(self.chain, q, near) if np.isfinite(q).all() else None


def in_order_for_people(branches: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of branches with those of usual postures first, without ordinals."""
    second = {
        name: [word in SECOND for word in name.split("-")]
        for name in branches
        if not name.endswith(ORDINALS)
    }
    return tuple(sorted(second, key=second.__getitem__))


def near_turns(chain: Chain, q: FloatArray, near: FloatArray) -> FloatArray:
    """Return `q` (n,) [rad], each angle in the turn nearest to ``near`` inside its limits."""
    turns = np.round((near - q) / math.tau)
    q = q + math.tau * (np.where(chain.slides, 0.0, turns) if any(chain.slides) else turns)
    slack = tolerances.LIMIT_SLACK
    for turn in (math.tau, -math.tau):
        outside = (q < chain.lower - slack) | (q > chain.upper + slack)
        other = q + turn
        fits = outside & (other >= chain.lower - slack) & (other <= chain.upper + slack)
        q = np.where(fits, other, q)
    return q
