"""The interface of inverse kinematics, whichever method computes them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse_batch import inverse_batch, validated_poses
from katana450.maths.kinematics.solution import Solutions
from katana450.maths.kinematics.solver import inverse


class Kinematics(Protocol):
    """Inverse kinematics of one chain.

    Attributes:
        chain: the chain, whose `M` is the pose of the tool.
        method: the method in a few words, for people.
        branches: the branches, in the order of the solutions.
    """

    @property
    def chain(self) -> Chain: ...  # noqa: D102
    @property
    def method(self) -> str: ...  # noqa: D102
    @property
    def branches(self) -> tuple[AnyBranch, ...]: ...  # noqa: D102

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return a solution for each branch of the pose `T` (4, 4) = T_S_tool [m].

        `q_hint` (n,) [rad] decides what the pose leaves free. Raises InputError for an invalid `T`
        or `q_hint`.
        """

    def inverse_batch(self, T: npt.ArrayLike) -> FloatArray:
        """Return the joint angles (N, branches, n) [rad] of poses `T` (N, 4, 4) [m], as `inverse`.

        Raises InputError for the first invalid pose.
        """


def inverse_one_by_one(kinematics: Kinematics, T: npt.ArrayLike) -> FloatArray:
    """Return `Kinematics.inverse_batch` of a method that solves one pose at a time."""
    q = [[solution.q for solution in kinematics.inverse(pose)] for pose in validated_poses(T)]
    return np.array(q).reshape(len(q), len(kinematics.branches), kinematics.chain.n)


@dataclass(frozen=True, eq=False)
class FiveAxisKinematics:
    """The closed form of the five-axis family behind the interface."""

    chain: Chain
    method: str = "closed form for five axes: pan, three parallel axes, roll"
    branches: ClassVar[tuple[AnyBranch, ...]] = BRANCHES

    def inverse(self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None) -> Solutions:
        """Return `inverse.inverse`."""
        return inverse(self.chain, T, q_hint=q_hint)

    def inverse_batch(self, T: npt.ArrayLike) -> FloatArray:
        """Return `inverse_batch.inverse_batch`."""
        return inverse_batch(self.chain, T)
