"""Joint angles for a pose of the tool."""

from __future__ import annotations

import math

import numpy as np

from katana450.errors import InputError
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import BRANCHES, Branch, branch_of
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.priority import Priority
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.tracker import leap

EXACT = 1e-9
"""[m] and [rad] Maximum error of a place that counts as reached."""


def check_range(chain: Chain, q: FloatArray) -> None:
    """Raise InputError, with the range, if an axis at ``q`` (n,) [rad] is beyond its limits."""
    if chain.within_limits(q):
        return
    number = int(np.maximum(chain.lower - q, q - chain.upper).argmax())
    value, low, high = (math.degrees(bounds[number]) for bounds in (q, chain.lower, chain.upper))
    raise InputError(
        f"Axis {number + 1} would be at {value:.1f} deg, beyond its limit: its range is "
        f"{low:.1f} to {high:.1f} deg."
    )


def branches_near(chain: Chain, q: FloatArray) -> tuple[Branch, ...]:
    """Return all branches, that of ``q`` (5,) [rad] first, then the one that is nearest to it."""
    here = branch_of(chain, q)
    near = sorted(BRANCHES, key=lambda each: (each.shoulder != here.shoulder, each != here))
    return tuple(near)


def reaching(
    chain: Chain, q: FloatArray, target: ToolTarget, branch: Branch | None
) -> FloatArray | None:
    """Return the joint angles (5,) [rad] for ``target``; None if it is out of reach.

    Args:
        chain: the arm with its tool.
        q: (5,) present joint angles [rad].
        target: pose of the tool, in {S}.
        branch: the only branch that may be used; None for all, the present one first.
    """
    here = branch_of(chain, q)
    for tried in branches_near(chain, q) if branch is None else (branch,):
        # With the other shoulder posture the same tool pose has other pitch and roll values.
        turned = branch is None and tried.shoulder != here.shoulder
        pose = target.turned_round() if turned else target
        found = leap(chain, q, pose, tried, Priority.POSE)
        if max(found.position_error, found.rotation_error) <= EXACT:
            return found.q
    return None
