"""The interface of inverse kinematics, whichever method computes them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
import numpy.typing as npt

from katana450.caching import cached_property
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.branch import BRANCHES, AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse_batch import inverse_batch, validated_poses
from katana450.maths.kinematics.solution import Solutions
from katana450.maths.kinematics.solver import inverse

CHECKED: Final = 8
"""Number of postures whose poses an arm solves when it is read."""


@dataclass(frozen=True, eq=False)
class Kinematics(ABC):
    """Inverse kinematics of one chain.

    Attributes:
        chain: the chain, whose `M` is the pose of the tool.
    """

    chain: Chain

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


@dataclass(frozen=True, eq=False)
class FiveAxisKinematics(Kinematics):
    """The closed form of the five-axis family behind the interface."""

    method: ClassVar[str] = "closed form for five axes: pan, three parallel axes, roll"
    branches: ClassVar[tuple[AnyBranch, ...]] = BRANCHES

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return `inverse.inverse`."""
        return inverse(self.chain, T, q_hint=q_hint)

    def inverse_batch(self, T: npt.ArrayLike) -> FloatArray:
        """Return `inverse_batch.inverse_batch`."""
        return inverse_batch(self.chain, T)
