"""A test of points that the tool point of an arm can reach, in any orientation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.caching import cached_property
from katana450.extensions.general_arms.descent import Descent
from katana450.extensions.general_arms.links import links_of
from katana450.extensions.general_arms.numerical import Numerical
from katana450.extensions.general_arms.regularity import Regularity
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.reachability.pose_solver import BoolArray
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority

STARTS: Final = 4
"""Number of postures from which a search begins, those with the nearest tool points first."""

SAMPLES: Final = 20_000
"""Number of random postures from which these are taken."""

EFFORT: Final = 60
"""Maximum effort of one search, in looks."""

REACHED: Final = 1e-6
"""[m] Distance from a point up to which the tool point is there."""


@dataclass(frozen=True, eq=False)
class PointSearch:
    """The search of one arm.

    Attributes:
        chain: the chain.
        accepts: returns (N,) whether postures (N, n) [rad] may be taken.
    """

    chain: Chain
    accepts: Callable[[FloatArray], BoolArray]

    @cached_property
    def _descent(self) -> Descent:
        search = Numerical(self.chain, links_of(self.chain, exact=False))
        return Descent(search, Regularity(self.chain.n))

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Postures (M, n) [rad] that may be taken, and their tool points (M, 3) [m]."""
        chain = self.chain
        q = np.random.default_rng(chain.n).uniform(chain.lower, chain.upper, (SAMPLES, chain.n))
        q = q[self.accepts(q)]
        return q, forward_batch(chain, q)[:, :3, 3]

    def reached(self, p: FloatArray) -> BoolArray:
        """Return (N, 1) whether the tool point can be at `p` (N, 3) [m] in {S}."""
        return np.array([self._reaches(point) for point in p], dtype=np.bool).reshape(-1, 1)

    def _reaches(self, point: FloatArray) -> bool:
        q, points = self._table
        if not len(q):
            return False
        goal = self._descent.goal(ToolPose.of(se3.from_rotation_translation(np.eye(3), point)))
        far = ((points - point) ** 2).sum(axis=1)
        for start in q[np.argsort(far, kind="stable")[:STARTS]].tolist():
            end = self._descent.run(goal, tuple(start), Priority.POSITION, EFFORT).q
            look = self._descent.look(goal, end)
            near = self._descent.misses(look, Priority.POSITION)[0] <= REACHED
            if near and self.accepts(np.array([end]))[0]:
                return True
        return False
