"""The scaling that follows a trajectory at its own times, and slower only where limits force it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from katana450.extensions.programs.trajectory_path import TrajectoryPath
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.planning.checkpoint import checkpoint
from katana450.maths.planning.pacing import KNOTS, SLOWING_POWER, SPEEDING_POWER, SampledPath
from katana450.maths.planning.path import Path
from katana450.maths.planning.scaling import Bounds, Scaling

PIECE_TIME: Final = 0.1
"""[s] Time of each piece of the slowness."""

MAX_PIECES: Final = 1200
"""Maximum number of pieces, for a trajectory of two minutes and more."""

ROUNDS: Final = 40
"""Number of rounds that make a trajectory slower where it is too fast, and faster where it was made
too slow."""

FACTORS: Final = (4.0, 2.0, 1.4, 1.0, 0.7, 0.5)
"""Fractions [1] of the joints' largest a and j that are tried. Large ones start and pause quickly,
small ones leave more of the joints' acceleration to the trajectory."""


def recorded_scaling(path: Path, bounds: Bounds) -> Scaling:
    """Return the scaling with the times of the trajectory ``path``, or slower within ``bounds``.

    The slowness is nowhere below that of the trajectory. Where a limit would be exceeded it is
    raised, for each of several limits a and j of tau(t); the scaling with the shortest duration is
    returned.
    """
    assert isinstance(path, TrajectoryPath)
    pieces = min(max(math.ceil(path.duration / PIECE_TIME), KNOTS), MAX_PIECES)
    sampled = SampledPath.of(path, bounds, pieces)
    own = np.full(pieces + 3, path.duration)
    joints = bounds.joints
    a = float((joints.acceleration / joints.speed).min())
    j = float((joints.jerk / joints.speed).min())
    tried = (_paced(sampled, own, factor * a, factor * j) for factor in FACTORS)
    return min(tried, key=lambda scaling: scaling.duration)


def _paced(sampled: SampledPath, own: FloatArray, a: float, j: float) -> Scaling:
    """Return the fastest scaling found with a slowness of at least ``own`` (K + 3,) [s].

    As in ``pacing.fastest`` a coefficient is raised while a limit is exceeded near it, and lowered
    while no limit is reached.
    """
    found: Scaling | None = None
    c = own
    for _ in range(ROUNDS):
        checkpoint()
        excess = sampled.excess(c, a, j)
        maximum = max(float(excess.max()), 1.0)
        scaling = Scaling(maximum * c, a, j)
        if found is None or scaling.duration < found.duration:
            found = scaling
        if maximum == 1.0 and c is own:
            break
        near = sampled.near(excess)
        factor = np.where(near > 1.0, near**SLOWING_POWER, near**SPEEDING_POWER)
        c = np.maximum(c * factor, own)
    assert found is not None
    return found
