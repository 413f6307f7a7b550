"""A posture of an arm for a pose, with what it misses; its properties are computed when read."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final, Protocol, overload

import numpy as np

from katana450 import tolerances
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_space

SINGULAR: Final = 1e-6
"""[1] Ratio of the smallest to the largest singular value of the Jacobian below which a posture
counts as singular. Translations in it are divided by the length of the arm."""

TURNS: Final = 1e-3
"""[1] Component of a unit motion of the joints from which on a joint takes part in it."""


Angles = tuple[float, ...]


class GeneralPosture:
    """A solution of an arm's inverse kinematics; a `SolvedPosture` of the core.

    `branch` names the branch; the solvers define the names.
    """

    __slots__ = ("_T", "_chain", "_errors", "_q", "_slack", "angles", "branch")

    angles: tuple[float, ...]
    """The joint angles [rad] as plain floats."""
    branch: str

    def __init__(
        self,
        chain: Chain,
        T: FloatArray,
        angles: tuple[float, ...],
        branch: str,
        slack: float = 0.0,
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
        return (
            self.position_error <= tolerances.SAME_POSITION + self._slack
            and self.rotation_error <= tolerances.SAME_ROTATION + self._slack
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
            reached = forward(self._chain, self.angles)
            self._errors = (
                math.dist(reached[:3, 3], self._T[:3, 3]),
                so3.angle(reached[:3, :3], self._T[:3, :3]),
            )
        return self._errors

    def __repr__(self) -> str:
        """Return a short description."""
        return f"GeneralPosture(angles={self.angles}, branch={self.branch!r})"


class Branched(Protocol):
    """A solver of a chain with named branches."""

    @property
    def chain(self) -> Chain:
        """The chain."""

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches, in the order of the solutions."""

    @property
    def slack(self) -> float:
        """The error [m], [rad] of an exact posture that the rounding of a file explains."""


class Postures(Sequence[GeneralPosture]):
    """The postures of one pose in the order of the branches, each created when it is first read."""

    __slots__ = ("_angles", "_joints", "_made", "_pose", "_solver")

    def __init__(
        self,
        solver: Branched,
        pose: FloatArray,
        angles: Sequence[Angles],
        joints: Callable[[Angles], Angles] = tuple,
    ) -> None:
        """Hold the ``angles`` of each branch of ``solver`` for ``pose`` (4, 4).

        ``joints`` returns the joint angles [rad] of angles.
        """
        self._solver = solver
        self._pose = pose
        self._angles = angles
        self._joints = joints
        self._made: list[GeneralPosture | None] = [None] * len(angles)

    def _posture(self, k: int) -> GeneralPosture:
        posture = self._made[k]
        if posture is None:
            solver, angles = self._solver, self._joints(self._angles[k])
            posture = self._made[k] = GeneralPosture(
                solver.chain, self._pose, angles, solver.branches[k], solver.slack
            )
        return posture

    def __len__(self) -> int:
        return len(self._angles)

    @overload
    def __getitem__(self, index: int) -> GeneralPosture: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[GeneralPosture, ...]: ...

    def __getitem__(self, index: int | slice) -> GeneralPosture | tuple[GeneralPosture, ...]:
        return tuple(self)[index] if isinstance(index, slice) else self._posture(index)

    def __iter__(self) -> Iterator[GeneralPosture]:
        return map(self._posture, range(len(self._angles)))

    def __repr__(self) -> str:
        """Return the postures as text."""
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
    """Return `GeneralPosture.singular` of the joint angles `q` (n,) [rad]."""
    _, sizes, Vt = np.linalg.svd(scaled_jacobian(chain, q))
    rank = int((sizes > SINGULAR * sizes[0]).sum())
    if rank == min(6, chain.n):
        return ()
    moving = np.abs(Vt[rank:]).max(axis=0)
    return tuple(np.flatnonzero(moving > TURNS).tolist())
