"""The branches as a choice: the cost of changing to each, and its distance from a singularity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.projection import Projection
from katana450.maths.kinematics.solution import Solution
from katana450.maths.kinematics.velocity import singular_values


@dataclass(frozen=True, eq=False)
class BranchMetrics:
    """One branch at a pose, with its cost and its quality.

    Attributes:
        branch: the branch.
        q: joint angles (n,) of the branch [rad].
        within_limits: True if the arm can go there.
        position_error, rotation_error: difference [m], [rad] from the pose.
        distance: the largest angle that any joint has to turn [rad].
        time: duration until all joints are there, each at its own maximum speed [s].
        smallest_singular_value: 0 in a singularity [1].
    """

    branch: AnyBranch
    q: FloatArray
    within_limits: bool
    position_error: float
    rotation_error: float
    distance: float
    time: float
    smallest_singular_value: float

    @staticmethod
    def of(chain: Chain, found: Solution | Projection, q: npt.ArrayLike) -> BranchMetrics:
        """Return the metrics of `found`, seen from the joint angles `q` (n,) [rad].

        Between two postures inside the limits the straight path in joint space is inside too, so
        distance and time belong to a path that the arm can follow.
        """
        turns = np.abs(found.q - chain.check_q(q))
        return BranchMetrics(
            branch=found.branch,
            q=found.q,
            within_limits=chain.within_limits(found.q),
            position_error=found.position_error,
            rotation_error=found.rotation_error,
            distance=float(turns.max()),
            time=float((turns / chain.speed).max()),
            smallest_singular_value=float(singular_values(chain, found.q)[-1]),
        )
