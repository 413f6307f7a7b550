"""The pitch that keeps the joints farthest from their limits along an arc."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from katana450.errors import InputError
from katana450.extensions.programs.planning.curves import Curve, Swing, ToolArc
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import AnyBranch, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.planning.jet import Jet
from katana450.maths.planning.posture import posture

ARC_SAMPLES: Final = 48
"""Number of intervals of the arc that are checked."""

SWINGS: Final = np.radians((-30.0, -15.0, 0.0, 15.0, 30.0))
"""First values for the amplitude of the pitch along the arc [rad]."""

MEANS: Final = 72
"""Number of mean pitches that are tried, all round."""

HALVINGS: Final = 12
"""Number of halvings of the steps that refine the best; the last is a thousandth of a degree."""


def roomiest(chain: Chain, branch: AnyBranch, arc: Curve) -> ToolArc:
    """Return `arc` with the swing of its pitch that keeps axes 1 to 4 farthest from their limits.

    The pitch is a mean plus a wave of the arc's own angle, found on a grid and then by ever smaller
    steps. Raises InputError when no such pitch keeps the joints inside on `branch`, and for an arm
    whose orientations are no pitches.
    """
    if not isinstance(arc, ToolArc) or not isinstance(branch, Branch):
        raise InputError(
            "`roomiest` chooses the pitch of a five-axis arm, and this one has "
            f"{chain.n} axes. Give the orientation, or leave it out to keep it."
        )
    grid = np.array(
        list(product(np.linspace(-math.pi, math.pi, MEANS, endpoint=False), SWINGS, SWINGS))
    )
    rooms = _rooms(chain, branch, arc, grid)
    best, room = grid[rooms.argmax()], float(rooms.max())
    if not room > 0.0:
        raise InputError(
            f"No pitch keeps the joints inside their limits along this arc on the branch {branch}. "
            "Move the arc, make it smaller, or take another branch."
        )
    step = np.array((math.tau / MEANS, SWINGS[1] - SWINGS[0], SWINGS[1] - SWINGS[0]))
    around = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    for _ in range(HALVINGS):
        step *= 0.5
        for _ in range(4):
            candidates = best + around * step
            rooms = _rooms(chain, branch, arc, candidates)
            if rooms.max() <= room:
                break
            best, room = candidates[rooms.argmax()], float(rooms.max())
    mean, sine, cosine = best.tolist()
    return replace(arc, pitch=Swing(mean, sine, cosine, 0.0, arc.angle))


def _rooms(chain: Chain, branch: Branch, arc: ToolArc, swings: FloatArray) -> FloatArray:
    """Return the minimum distance (G,) [rad] of axes 1 to 4 from their limits on the arc.

    `swings` (G, 3) are the tried pitches. The value is below 0 beyond the limits, and -infinity out
    of reach.
    """
    arm = arm_of(chain)
    sigma = np.linspace(0.0, 1.0, ARC_SAMPLES + 1)
    tool = arc.at(Jet.constant(sigma))
    t = arc.angle * sigma
    pitch = swings @ np.stack((np.ones_like(t), np.sin(t), np.cos(t)))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        alpha = posture(arm, branch, *tool[:3], Jet.constant(pitch), tool.roll)
    room = np.full(len(swings), np.inf)
    for axis in range(4):
        q = (alpha[axis].c0 - arm.shifts[axis]) * arm.signs[axis]
        lower, upper = chain.lower[axis], chain.upper[axis]
        middle = 0.5 * (lower + upper)
        off = np.abs(np.remainder(q - middle + math.pi, math.tau) - math.pi)
        minimum = np.min(0.5 * (upper - lower) - off, axis=-1)
        room = np.minimum(room, np.where(np.isnan(minimum), -np.inf, minimum))
    return room
