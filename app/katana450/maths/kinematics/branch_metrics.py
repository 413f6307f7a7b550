"""The branches as a choice: what each costs to take, and how good it is to stand on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.inverse import Solution, inverse
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.velocity import singular_values


@dataclass(frozen=True, eq=False)
class BranchMetrics:
    """One way to stand at a pose, and what speaks for and against it.

    q: (n,) the joint angles there [rad]. within_limits: whether the arm can go there.
    position_error [m], rotation_error [rad]: what it misses the pose by. distance: the farthest any
    joint has to go [rad]. time: until all are there, each at its own greatest speed [s].
    smallest_singular_value [1]: 0 in a singularity.
    """

    branch: Branch
    q: FloatArray
    within_limits: bool
    position_error: float
    rotation_error: float
    distance: float
    time: float
    smallest_singular_value: float

    @staticmethod
    def of(chain: Chain, found: Solution | Projection, q: npt.ArrayLike) -> BranchMetrics:
        """That of `found`, seen from `q` (n,) [rad].

        Between two postures inside the limits the straight way in joint space is inside too, so
        distance and time are of a way the arm can go.
        """
        way = np.abs(found.q - chain.check_q(q))
        return BranchMetrics(
            branch=found.branch,
            q=found.q,
            within_limits=chain.within_limits(found.q),
            position_error=found.position_error,
            rotation_error=found.rotation_error,
            distance=float(way.max()),
            time=float((way / chain.speed).max()),
            smallest_singular_value=float(singular_values(chain, found.q)[-1]),
        )


def branches(chain: Chain, T: npt.ArrayLike, q: npt.ArrayLike) -> tuple[BranchMetrics, ...]:
    """Every branch of the pose `T` (4, 4) = T_S_tool [m] seen from `q` (5,) [rad].

    In the order of BRANCHES; `T` as for `inverse`, and errors as of it.
    """
    return tuple(BranchMetrics.of(chain, solution, q) for solution in inverse(chain, T, q_hint=q))
