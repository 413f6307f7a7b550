"""Inverse kinematics in closed form: every joint vector that puts the tool at a pose.

The paper's eq. (12) to (29), followed for both shoulders and both elbows. The module
maths/kinematics/closed_form.py lists the steps, each with its subproblem and number of solutions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import overload

import numpy as np
import numpy.typing as npt

from katana450 import tolerances
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.geometry.se3 import Rows
from katana450.maths.kinematics.arm import Five, FiveAxisArm
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.solver import FourBranches, Solver
from katana450.maths.kinematics.turns import nearest_turn


class Solution:
    """One solution of `inverse`; its properties are computed when they are first read."""

    __slots__ = ("_chain", "_errors", "_q", "_rows", "angles", "branch")

    angles: Five
    """The joint angles [rad] as plain floats."""
    branch: Branch
    """The branch of the solution."""

    def __init__(self, chain: Chain, rows: Rows, angles: Five, branch: Branch) -> None:
        self._chain = chain
        self._rows = rows
        self._q: FloatArray | None = None
        self._errors: tuple[float, float] | None = None
        self.angles = angles
        self.branch = branch

    @property
    def q(self) -> FloatArray:
        """The joint angles (5,) [rad], read-only."""
        if self._q is None:
            self._q = frozen(self.angles)
        return self._q

    @property
    def within_limits(self) -> bool:
        """True if the joint angles are inside the chain's limits."""
        return Solver.of(self._chain).inside(self.angles)

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
        """True if the arm takes the target pose, to within rounding, also that of its file."""
        length, turn = _rounding(Solver.of(self._chain).arm, self._rows)
        return (
            self.position_error <= tolerances.SAME_POSITION + length
            and self.rotation_error <= tolerances.SAME_ROTATION + turn
        )

    def _measured(self) -> tuple[float, float]:
        if self._errors is None:
            canonical, reached = np.array(self._rows), forward(self._chain, self.angles)
            self._errors = (
                math.dist(reached[:3, 3], canonical[:3, 3]),
                so3.angle(reached[:3, :3], canonical[:3, :3]),
            )
        return self._errors

    def __repr__(self) -> str:
        return f"Solution(angles={self.angles}, branch={self.branch})"


def _rounding(arm: FiveAxisArm, rows: Rows) -> tuple[float, float]:
    """Return the errors [m], [rad] of a pose that rounding in the arm's file explains.

    Each of four axes may be off by `skew`, and so displaces the parts on it by a `length`. theta1
    follows from a point sqrt(rho^2 - d^2) outward of axis 1. A displacement by the length turns
    theta1 by its ratio to this distance; nearer than the length theta1 is undetermined. A tool
    point beside the roll axis turns with it.
    """
    length = 4.0 * (arm.skew * arm.reach + arm.gap)
    if length == 0.0:
        return 0.0, 0.0
    x, y = arm.pose(np.array(rows))[:2, 3].tolist()
    rho, d = math.hypot(x, y), abs(arm.d)
    outward = math.sqrt(abs(rho - d) * (rho + d) + length * (length + 2.0 * d))
    turn = 4.0 * arm.skew + length / outward
    return length + turn * arm.off_axis, turn


class FourSolutions(Sequence[Solution]):
    """The solutions of `inverse` in the order of BRANCHES, created on first access."""

    __slots__ = ("_angles", "_chain", "_made", "_rows")

    def __init__(self, chain: Chain, rows: Rows, angles: FourBranches) -> None:
        self._chain = chain
        self._rows = rows
        self._angles = angles
        self._made: tuple[Solution, ...] | None = None

    def _all(self) -> tuple[Solution, ...]:
        if self._made is None:
            self._made = tuple(
                Solution(self._chain, self._rows, angles, branch)
                for angles, branch in zip(self._angles, BRANCHES, strict=True)
            )
        return self._made

    def __len__(self) -> int:
        return len(BRANCHES)

    @overload
    def __getitem__(self, index: int) -> Solution: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Solution, ...]: ...

    def __getitem__(self, index: int | slice) -> Solution | tuple[Solution, ...]:
        return self._all()[index]

    def __iter__(self) -> Iterator[Solution]:
        return iter(self._all())

    def __repr__(self) -> str:
        return repr(self._all())


def inverse(
    chain: Chain, T: npt.ArrayLike, *, q_hint: npt.ArrayLike | None = None
) -> FourSolutions:
    """Return the four solutions for the pose `T` (4, 4) = T_S_tool [m], in the order of BRANCHES.

    Two solutions coincide where their branches meet (arm stretched or folded, tool point on axis
    1).

    `T` should be a pose that five axes can take. For any other pose the solutions hold the tool
    point, or come nearest to it along each link, with the tool's roll axis nearest in the plane.
    Their errors give the difference. Where the arm's plane passes beside axis 1, only one shoulder
    can take a pose: the two solutions of the other shoulder miss its yaw.

    Each angle is in the turn that fits the limits if there is one, else in [-pi, pi]. Limits wider
    than a turn leave a choice: the turn nearest to `q_hint` (5,) [rad]. With tool point and roll
    axis both on axis 1, theta1 is free: it is then that of the hint, or 0.

    Raises InputError for an invalid `T` or `q_hint`, RobotDescriptionError for an arm outside the
    family. Source: the paper's eq. (12)-(29). For loops without checks: `Solver`.
    """
    solver = Solver.of(chain)
    rows = se3.validated_rows(T)
    if q_hint is None:
        return FourSolutions(chain, rows, solver.solve(rows))
    hint = chain.check_q(q_hint)
    one, two, three, four = solver.solve(rows, float(hint[0]))
    found = _near(chain, one, hint), _near(chain, two, hint)
    return FourSolutions(chain, rows, (*found, _near(chain, three, hint), _near(chain, four, hint)))


def _near(chain: Chain, q: Five, hint: FloatArray) -> Five:
    one, two, three, four, five = nearest_turn(chain, np.array(q), hint).tolist()
    return one, two, three, four, five
