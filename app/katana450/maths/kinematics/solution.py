"""The solutions of an inverse kinematics, with what they miss; all is computed when it is read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final, overload

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space

SINGULAR: Final = 1e-6
"""[1] Ratio of the smallest to the largest singular value of the Jacobian below which a posture
counts as singular. Translations in it are divided by the length of the arm."""

TURNS: Final = 1e-3
"""[1] Component of a unit motion of the joints from which on a joint takes part in it."""


Angles = tuple[float, ...]

Slack = Callable[[npt.ArrayLike], tuple[float, float]]
"""Returns the errors [m], [rad] of an exact solution that rounding in the arm's file explains."""


def no_slack(_T: npt.ArrayLike) -> tuple[float, float]:
    """Return the errors of an arm whose file has no rounding: none."""
    return 0.0, 0.0


class Solution:
    """One solution of an inverse kinematics; its properties are computed when they are first read.

    The kinematics define the branches.
    """

    __slots__ = ("_T", "_chain", "_errors", "_q", "_slack", "angles", "branch")

    angles: Angles
    """The joint angles [rad] as plain floats."""
    branch: AnyBranch
    """The branch of the solution."""

    def __init__(
        self,
        chain: Chain,
        T: npt.ArrayLike,
        angles: Angles,
        branch: AnyBranch,
        slack: Slack = no_slack,
    ) -> None:
        self._chain = chain
        self._T = T
        self._slack = slack
        self._q: FloatArray | None = None
        self._errors: tuple[float, float] | None = None
        self.angles = angles
        self.branch = branch

    @property
    def q(self) -> FloatArray:
        """The joint angles (n,) [rad], read-only."""
        if self._q is None:
            self._q = frozen(self.angles)
        return self._q

    @property
    def within_limits(self) -> bool:
        """True if every angle is inside its limits."""
        return self._chain.within_limits(self.q)

    @property
    def position_error(self) -> float:
        """The distance [m] between the target pose and the pose of the forward kinematics."""
        return self._measured()[0]

    @property
    def rotation_error(self) -> float:
        """The angle [rad] between the target pose and the pose of the forward kinematics."""
        return self._measured()[1]

    @property
    def exact(self) -> bool:
        """True if the arm takes the target pose, to within rounding, also that of its file.

        Else it is the nearest.
        """
        length, turn = self._slack(self._T)
        return (
            self.position_error <= tolerances.SAME_POSITION + length
            and self.rotation_error <= tolerances.SAME_ROTATION + turn
        )

    @property
    def singular(self) -> tuple[int, ...]:
        """Indices, from 0, of the axes that turn together without moving the tool; see SINGULAR.

        Empty in a regular posture. An arm of more than six axes can always turn some; they are not
        counted unless the arm can turn in two such ways.
        """
        return singular_axes(self._chain, self.q)

    def _measured(self) -> tuple[float, float]:
        if self._errors is None:
            T, reached = np.array(self._T), forward(self._chain, self.angles)
            self._errors = (
                math.dist(reached[:3, 3], T[:3, 3]),
                so3.angle(reached[:3, :3], T[:3, :3]),
            )
        return self._errors

    def __repr__(self) -> str:
        """Return a short description."""
        return f"Solution(angles={self.angles}, branch={self.branch})"


class Solutions(Sequence[Solution]):
    """The solutions of one pose in the order of the branches, each computed when first read."""

    __slots__ = ("_T", "_branches", "_chain", "_made", "_rest", "_slack")

    def __init__(
        self,
        chain: Chain,
        T: npt.ArrayLike,
        angles: Iterable[Angles],
        branches: Sequence[AnyBranch],
        slack: Slack = no_slack,
    ) -> None:
        """Hold the joint ``angles`` [rad] of each of ``branches`` for the pose `T` (4, 4)."""
        self._chain = chain
        self._T = T
        self._rest = iter(angles)
        self._branches = branches
        self._slack = slack
        self._made: list[Solution] = []

    def _solution(self, k: int) -> Solution:
        solutions = self._made
        while len(solutions) <= k:
            branch = self._branches[len(solutions)]
            solutions.append(Solution(self._chain, self._T, next(self._rest), branch, self._slack))
        return solutions[k]

    def __len__(self) -> int:
        return len(self._branches)

    @overload
    def __getitem__(self, index: int) -> Solution: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Solution, ...]: ...

    def __getitem__(self, index: int | slice) -> Solution | tuple[Solution, ...]:
        if isinstance(index, slice):
            return tuple(self)[index]
        return self._solution(range(len(self._branches))[index])

    def __iter__(self) -> Iterator[Solution]:
        return map(self._solution, range(len(self._branches)))

    def __repr__(self) -> str:
        """Return the solutions as text."""
        return repr(tuple(self))


def scaled_jacobian(chain: Chain, q: Sequence[float] | FloatArray) -> FloatArray:
    """Return the (6, n) Jacobian at the tool point, translations divided by the arm's length."""
    J = jacobian_space(chain, q)
    tip = forward(chain, q)[:3, 3]
    J[3:] += np.cross(J[:3], tip, axis=0)
    scale = float(np.linalg.norm(J[3:], axis=0).max())
    if scale > 0.0:
        J[3:] /= scale
    return J


def singular_axes(chain: Chain, q: Sequence[float] | FloatArray) -> tuple[int, ...]:
    """Return `Solution.singular` of the joint angles `q` (n,) [rad]."""
    _, sizes, Vt = np.linalg.svd(scaled_jacobian(chain, q))
    rank = int((sizes > SINGULAR * sizes[0]).sum())
    if rank == min(6, chain.n):
        return ()
    moving = np.abs(Vt[rank:]).max(axis=0)
    return tuple(np.flatnonzero(moving > TURNS).tolist())
