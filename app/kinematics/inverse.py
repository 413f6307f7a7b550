"""Inverse kinematics in closed form: every joint vector that puts the tool at a pose.

The paper's eq. (12) to (29) with both shoulders and both elbows followed; the steps, each with its
subproblem and number of solutions, stand in app/kinematics/closed_form.py.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from app import tolerances
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray, frozen
from app.geometry.se3 import Rows
from app.kinematics.arm import Five
from app.kinematics.branch import BRANCHES, Branch
from app.kinematics.chain import Chain
from app.kinematics.forward import forward
from app.kinematics.solver import Solver
from app.kinematics.turns import nearest_turn


class Solution:
    """One answer of `inverse`; what is not asked of it is not computed."""

    __slots__ = ("_chain", "_errors", "_q", "_rows", "angles", "branch")

    angles: Five
    """The joint angles [rad] as plain floats."""
    branch: Branch
    """How the arm stands."""

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
        """Whether q is inside the chain's limits."""
        return Solver.of(self._chain).inside(self.angles)

    @property
    def position_error(self) -> float:
        """Distance [m] between the asked pose and that which forward kinematics gives of q."""
        return self._measured()[0]

    @property
    def rotation_error(self) -> float:
        """Angle [rad] between the same two."""
        return self._measured()[1]

    @property
    def exact(self) -> bool:
        """Whether the arm takes the asked pose there, to rounding, that of its file included."""
        arm = Solver.of(self._chain).arm
        rounding = 2.0 * (arm.skew * arm.reach + arm.gap)
        return (
            self.position_error <= tolerances.SAME_POSITION + rounding
            and self.rotation_error <= tolerances.SAME_ROTATION + 4.0 * arm.skew
        )

    def _measured(self) -> tuple[float, float]:
        if self._errors is None:
            asked, reached = np.array(self._rows), forward(self._chain, self.angles)
            self._errors = (
                math.dist(reached[:3, 3], asked[:3, 3]),
                so3.angle(reached[:3, :3], asked[:3, :3]),
            )
        return self._errors

    def __repr__(self) -> str:
        return f"Solution(angles={self.angles}, branch={self.branch})"


def inverse(
    chain: Chain, T: npt.ArrayLike, *, q_hint: npt.ArrayLike | None = None
) -> tuple[Solution, ...]:
    """The four solutions for the pose `T` (4, 4) = T_S_tool [m], in the order of BRANCHES.

    Two coincide where their branches meet (arm stretched or folded, tool point on axis 1). `T`
    should be a pose the five axes can do; of any other come back the angles that hold the tool
    point, else come nearest to it along each link, with the tool's roll axis nearest in the plane,
    and the errors say by how much they miss. Where the arm's plane passes beside axis 1 one
    shoulder alone can do a pose: the other's two solutions miss its yaw. Angles are in the turn
    that fits the limits when one does, else in [-pi, pi]; limits wider than a turn leave a choice,
    which falls on the turn nearest to `q_hint` (5,) [rad]. With tool point and tool both along axis
    1 theta1 is free: it is then that of the hint, or 0.

    Raises InputError for a `T` or `q_hint` that cannot be used, RobotDescriptionError for an arm of
    another kind. Source: the paper's eq. (12)-(29). For loops without checks: `Solver`.
    """
    solver = Solver.of(chain)
    rows = se3.validated_rows(T)
    if q_hint is None:
        one, two, three, four = solver.solve(rows)
    else:
        hint = chain.check_q(q_hint)
        found = solver.solve(rows, float(hint[0]))
        one, two, three, four = (nearest_turn(chain, np.array(q), hint).tolist() for q in found)
    front_up, front_down, back_up, back_down = BRANCHES
    return (
        Solution(chain, rows, one, front_up),
        Solution(chain, rows, two, front_down),
        Solution(chain, rows, three, back_up),
        Solution(chain, rows, four, back_down),
    )
