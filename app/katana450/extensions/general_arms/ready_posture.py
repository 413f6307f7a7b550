"""The posture in which an arm outside the five-axis family starts."""

from __future__ import annotations

import itertools
from typing import Final

import numpy as np

from katana450.extensions.general_arms.descent import Descent
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain

ANGLES: Final = tuple(np.radians((-90.0, -45.0, 0.0, 45.0, 90.0)).tolist())
"""[rad] Angles from the middle of the limits that are tried for the joints between the ends."""

MAX_TURNED: Final = 5
"""Maximum number of joints that are turned from the middle of their limits."""

ROOM: Final = 0.05
"""[1] Minimum distance from the limits, as a fraction of the range of a joint."""

HEIGHT: Final = 0.35
"""[1] Preferred height of the tool over the base, as a fraction of the reach of the arm."""


def ready_posture(descent: Descent, T_base_shoulder: FloatArray) -> FloatArray:
    """Return the joint angles (n,) [rad] of a useful first posture.

    The first joint, and the last one of arms with six and more axes, stand in the middle of their
    limits. The others are a few right or half right angles away from it: far from a singularity,
    with the tool in front of the base and at a medium height, and turned as little as that allows.
    """
    chain = descent.search.chain
    q = _candidates(chain)
    T = T_base_shoulder @ forward_batch(chain, q)
    reach = descent.search.links.reach
    least = np.array([_least(descent, each) for each in q.tolist()])
    height = T[:, 2, 3] / reach
    ahead = T[:, 0, 3] / reach
    turned = np.abs(q - q[0]).sum(axis=1)
    upright = np.abs(T[:, :3, :3]).max(axis=2).min(axis=1)
    score = np.minimum(least, 0.25) / 0.25 + 0.5 * np.clip(ahead, -0.5, 0.5) + 0.5 * upright
    score -= 0.05 * turned + np.abs(height - HEIGHT)
    return np.array(q[int(score.argmax())])


def _candidates(chain: Chain) -> FloatArray:
    """Return postures (N, n) [rad] inside the limits, that in the middle first."""
    middle = 0.5 * (chain.lower + chain.upper)
    room = ROOM * (chain.upper - chain.lower)
    ends = (0,) if chain.n < 6 else (0, chain.n - 1)
    turning = [k for k in range(chain.n) if k not in ends][:MAX_TURNED]
    turns = np.array(sorted(itertools.product(ANGLES, repeat=len(turning)), key=_size))
    q = np.tile(middle, (len(turns), 1))
    q[:, turning] += turns
    return np.clip(q, chain.lower + room, chain.upper - room)


def _size(turns: tuple[float, ...]) -> float:
    return sum(map(abs, turns))


def _least(descent: Descent, q: list[float]) -> float:
    _, moved = descent.search.motion(q)
    J = np.array(moved).T
    J[3:] /= descent.search.length
    return descent.regularity.least(descent.regularity.matrix(J))
