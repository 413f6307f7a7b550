"""Accuracy of the answers of a solver, always measured by the app's forward kinematics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.kinematics_task import SOLVED_POSITION, SOLVED_ROTATION, FloatArray
from katana450.maths.geometry import so3
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward

_SAME_ANGLES = 1e-6  # rad; answers nearer than this in every joint are one branch


@dataclass(frozen=True)
class Quality:
    """The accuracy over all poses.

    Attributes:
        solved: fraction of poses with a correct answer.
        worst: maximum position error of all answers given as exact [m].
        branches: number of distinct correct answers per pose.
        inside: number of those inside the limits.
        usable: fraction of poses with a correct answer inside the limits.
    """

    solved: float
    worst: float
    branches: float
    inside: float
    usable: float


def quality(chain: Chain, T: FloatArray, answers: Sequence[FloatArray]) -> Quality:
    """Return the quality of `answers`, (k, 5) [rad] for each pose of `T` (N, 4, 4)."""
    # An angle inside the limits is the one nearest to their middle among its whole turns.
    middle = 0.5 * (chain.lower + chain.upper)
    worst, branches, inside = 0.0, [], []
    for target, candidates in zip(T, answers, strict=True):
        right: list[FloatArray] = []
        for q in candidates:
            reached = forward(chain, q)
            position = math.dist(reached[:3, 3], target[:3, 3])
            rotation = so3.angle(reached[:3, :3], target[:3, :3])
            worst = max(worst, position)
            if position <= SOLVED_POSITION and rotation <= SOLVED_ROTATION:
                turned = q - math.tau * np.rint((q - middle) / math.tau)
                if not any(_same(turned, other) for other in right):
                    right.append(turned)
        branches.append(len(right))
        inside.append(sum(chain.within_limits(q) for q in right))
    return Quality(
        solved=float(np.mean(np.array(branches) > 0)),
        worst=worst,
        branches=float(np.mean(branches)),
        inside=float(np.mean(inside)),
        usable=float(np.mean(np.array(inside) > 0)),
    )


def _same(a: FloatArray, b: FloatArray) -> bool:
    gap = np.abs(a - b) % math.tau
    return bool(np.minimum(gap, math.tau - gap).max() < _SAME_ANGLES)
