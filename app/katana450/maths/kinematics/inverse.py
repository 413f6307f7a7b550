"""Inverse kinematics in closed form: every joint vector that puts the tool at a pose.

The paper's eq. (12) to (29), followed for both shoulders and both elbows. The module
maths/kinematics/closed_form.py lists the steps, each with its subproblem and number of solutions.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry import se3
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.solution import Solutions
from katana450.maths.kinematics.solver import Solver
from katana450.maths.kinematics.turns import nearest_turn


def inverse(chain: Chain, T: npt.ArrayLike, *, q_hint: npt.ArrayLike | None = None) -> Solutions:
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
        return Solutions(chain, rows, solver.solve(rows), BRANCHES, solver.slack)
    hint = chain.check_q(q_hint)
    angles = [
        tuple(nearest_turn(chain, np.array(q), hint).tolist())
        for q in solver.solve(rows, float(hint[0]))
    ]
    return Solutions(chain, rows, angles, BRANCHES, solver.slack)
