"""The interface of inverse kinematics, whichever method computes them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse import inverse


class SolvedPosture(Protocol):
    """Joint angles for a pose, with their distance from it; `inverse.Solution` is one.

    Attributes:
        q: joint angles (n,) [rad].
        branch: name of the branch, by `str`.
        within_limits: whether every angle is inside its limits.
        position_error, rotation_error: distance [m] and angle [rad] between the target and the pose
            that forward kinematics gives for `q`.
        exact: whether both are only rounding.
    """

    @property
    def q(self) -> FloatArray: ...  # noqa: D102
    @property
    def branch(self) -> object: ...  # noqa: D102
    @property
    def within_limits(self) -> bool: ...  # noqa: D102
    @property
    def position_error(self) -> float: ...  # noqa: D102
    @property
    def rotation_error(self) -> float: ...  # noqa: D102
    @property
    def exact(self) -> bool: ...  # noqa: D102


class Kinematics(Protocol):
    """Inverse kinematics of one chain.

    Attributes:
        chain: the chain, whose `M` is the pose of the tool.
        method: the method in a few words, for people.
    """

    @property
    def chain(self) -> Chain: ...  # noqa: D102
    @property
    def method(self) -> str: ...  # noqa: D102

    def inverse(
        self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None
    ) -> Sequence[SolvedPosture]:
        """Return a posture for each branch of the pose `T` (4, 4) = T_S_tool [m].

        `q_hint` (n,) [rad] decides what the pose leaves free. Raises InputError for an invalid `T`
        or `q_hint`.
        """


@dataclass(frozen=True, eq=False)
class FiveAxisKinematics:
    """The closed form of the five-axis family behind the interface."""

    chain: Chain
    method: str = "closed form for five axes: pan, three parallel axes, roll"

    def inverse(
        self, T: npt.ArrayLike, q_hint: npt.ArrayLike | None = None
    ) -> Sequence[SolvedPosture]:
        """Return `inverse.inverse`."""
        return inverse(self.chain, T, q_hint=q_hint)
