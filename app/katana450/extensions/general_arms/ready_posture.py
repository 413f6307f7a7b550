"""The posture in which an arm outside the five-axis family starts."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Final

import numpy as np

from katana450.extensions.general_arms.descent import Descent
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.batch import forward_batch
from katana450.maths.kinematics.chain import Chain

ANGLES: Final = tuple(np.radians((0.0, 45.0, -45.0, 90.0, -90.0, 135.0, -135.0)).tolist())
"""[rad] Angles that are tried for the joints that turn."""

ROOM: Final = 0.1
"""[1] Minimum distance from the limits, as a fraction of the range of a joint."""

HEIGHT: Final = 0.35
"""[1] Preferred height of the tool over the base, as a fraction of the reach of the arm."""

REGULAR: Final = 0.25
"""[1] Smallest singular value from which on a posture is far enough from a singularity."""

MAX_COMPARED: Final = 400
"""Maximum number of postures whose axes are compared; the pose of the tool chooses them."""


def ready_posture(descent: Descent, T_base_shoulder: FloatArray) -> FloatArray:
    """Return the joint angles (n,) [rad] of a useful first posture.

    The first joint, the last one of arms with six and more axes, and the third one of arms with
    seven stand at zero if their limits allow it. The others have multiples of 45 degrees: far from
    a singularity, with the tool in front of the base and at a medium height, no axis behind the
    shoulder much lower than that, and turned as little as that allows.
    """
    chain = descent.search.chain
    q = _candidates(chain)
    T = T_base_shoulder @ forward_batch(chain, q)
    reach = descent.search.links.reach
    along = np.abs(T[:, :3, :3]).max(axis=2)
    score = 0.5 * along[:, 2] + 0.25 * along.min(axis=1)
    score += 0.5 * np.clip(T[:, 0, 3] / reach, -0.5, 0.5) - np.abs(T[:, 2, 3] / reach - HEIGHT)
    score -= 0.02 * np.abs(q).sum(axis=1)
    best = np.argsort(-score, kind="stable")[:MAX_COMPARED]
    q, T, score = q[best], T[best], score[best]
    twists = [descent.search.motion(each)[1] for each in q.tolist()]
    score += np.minimum([_least(descent, each) for each in twists], REGULAR) / REGULAR
    score += np.minimum(_lowest_axis(np.array(twists), T, T_base_shoulder) / reach, HEIGHT)
    return np.array(q[int(score.argmax())])


def _candidates(chain: Chain) -> FloatArray:
    """Return postures (N, n) [rad] inside the limits."""
    room = ROOM * (chain.upper - chain.lower)
    lower, upper = (chain.lower + room).tolist(), (chain.upper - room).tolist()
    still = {0} if chain.n < 6 else {0, chain.n - 1}
    # The third of seven axes is the swivel: the arm stands in one plane without it.
    still |= set(range(2, chain.n - 4))
    choices = []
    for k, (low, high) in enumerate(zip(lower, upper, strict=True)):
        inside = [each for each in ANGLES if low <= each <= high]
        if k in still and 0.0 in inside:
            inside = [0.0]
        elif k in still or not inside:
            inside = [0.5 * (low + high)]
        choices.append(inside)
    return np.array(list(itertools.product(*choices)))


def _lowest_axis(twists: FloatArray, T: FloatArray, T_base_shoulder: FloatArray) -> FloatArray:
    """Return the heights (N,) [m] of the lowest of the axes 3 and on, each nearest to the tool.

    Args:
        twists: (N, n, 6) rotation and velocity of the tool point by each axis, in frame {S}.
        T: (N, 4, 4) poses of the tool in the base frame.
        T_base_shoulder: (4, 4) frame {S}.
    """
    w, v = twists[:, 2:, :3], twists[:, 2:, 3:]
    arms = np.cross(v, w) @ T_base_shoulder[2, :3]
    lowest: FloatArray = T[:, 2, 3] - arms.max(axis=1)
    return lowest


def _least(descent: Descent, moved: Sequence[Sequence[float]]) -> float:
    J = np.array(moved).T
    J[3:] /= descent.search.length
    return descent.regularity.least(descent.regularity.matrix(J))
