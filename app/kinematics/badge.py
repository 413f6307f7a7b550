"""The branches as a choice: what each costs to take, and how good it is to stand on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.kinematics.chain import Chain
from app.kinematics.inverse import Solution, inverse
from app.kinematics.velocity import singular_values


@dataclass(frozen=True, eq=False)
class Badge:
    """One branch of a pose, and what speaks for and against it.

    solution: the joint angles there, the limits verdict, the residuals. distance: the farthest any
    joint has to go [rad]. time: until all are there, each at its own greatest speed [s].
    smallest_singular_value [1]: 0 in a singularity.
    """

    solution: Solution
    distance: float
    time: float
    smallest_singular_value: float


def branches(chain: Chain, T: npt.ArrayLike, q: npt.ArrayLike) -> tuple[Badge, ...]:
    """Every branch of the pose `T` (4, 4) = T_S_tool [m] seen from `q` (5,) [rad].

    In the order of BRANCHES; `T` as for `inverse`, and errors as of it. Between two postures inside
    the limits the straight way in joint space is inside too, so distance and time are of a way the
    arm can go.
    """
    q = chain.check_q(q)
    return tuple(_badge(chain, solution, q) for solution in inverse(chain, T, q_hint=q))


def _badge(chain: Chain, solution: Solution, q: npt.NDArray[np.float64]) -> Badge:
    way = np.abs(solution.q - q)
    return Badge(
        solution=solution,
        distance=float(way.max()),
        time=float((way / chain.speed).max()),
        smallest_singular_value=float(singular_values(chain, solution.q)[-1]),
    )
