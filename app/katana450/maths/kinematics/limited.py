"""The canonical arm with limits: those of its chain, narrower ones, or none."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from katana450.maths.kinematics.arm import Five, FiveAxisArm, arm_of
from katana450.maths.kinematics.branch import BRANCHES, Branch
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.planar import ANY_ANGLE, Interval, PlanarArm

Intervals = tuple[Interval, Interval, Interval, Interval, Interval]


@dataclass(frozen=True, eq=False)
class LimitedArm:
    """The canonical arm `arm` with the range of angles [rad] of each axis."""

    arm: FiveAxisArm
    limits: Intervals
    _planar: dict[Branch, tuple[PlanarArm, ...]] = field(default_factory=dict, repr=False)

    @staticmethod
    def of(chain: Chain, *, within_limits: bool = True) -> LimitedArm:
        """Return the arm of `chain`; the result is cached.

        With `within_limits` False the arm has no limits. Raises RobotDescriptionError as `arm_of`.
        """
        return _limited(chain, within_limits)

    def near(self, alpha: Five, reach: float, theta1: Interval) -> LimitedArm:
        """Return the arm with axes 2 to 5 within `reach` [rad] of `alpha`, axis 1 in `theta1`."""
        _, two, three, four, five = (
            Interval(max(lower, angle - reach), min(upper, angle + reach))
            for (lower, upper), angle in zip(self.limits, alpha, strict=True)
        )
        return LimitedArm(self.arm, (theta1, two, three, four, five))

    def turned(self, alpha: Five, hint: Five) -> Five:
        """Return `alpha` in those turns inside the limits that are nearest to `hint`."""
        one, two, three, four, five = (
            _in_turn(limits, angle, near)
            for limits, angle, near in zip(self.limits, alpha, hint, strict=True)
        )
        return one, two, three, four, five

    def planar(self, branch: Branch | None) -> list[tuple[Branch, PlanarArm]]:
        """Return axes 2 to 4 on `branch`, or on every branch that the limits allow.

        There is one arm for each piece of theta3. If the limits exclude the elbow of `branch`, the
        piece is the limit nearest to it.
        """
        if branch is not None:
            return [(branch, arm) for arm in self._pieces(branch)]
        _, _, theta3, _, _ = self.limits
        return [
            (candidate, arm)
            for candidate in BRANCHES
            if _bends(theta3, _bend(candidate))
            for arm in self._pieces(candidate)
        ]

    def _pieces(self, branch: Branch) -> tuple[PlanarArm, ...]:
        pieces = self._planar.get(branch)
        if pieces is None:
            arm, (_, theta2, theta3, theta4, _) = self.arm, self.limits
            bend, side = _bend(branch), 1 if branch.shoulder == "front" else -1
            pieces = tuple(
                PlanarArm(arm.l1, arm.l2, arm.l3, theta2, piece, theta4, sign, -arm.a, side)
                for sign, piece in _bends(theta3, bend) or _least_bend(theta3, -bend)
            )
            self._planar[branch] = pieces
        return pieces


@lru_cache(maxsize=64)
def _limited(chain: Chain, within_limits: bool) -> LimitedArm:
    arm = arm_of(chain)
    if not within_limits:
        return LimitedArm(arm, (ANY_ANGLE,) * 5)
    ends = np.sort((arm.canonical(chain.lower), arm.canonical(chain.upper)), axis=0)
    one, two, three, four, five = (Interval(*pair) for pair in ends.T.tolist())
    return LimitedArm(arm, (one, two, three, four, five))


def _bend(branch: Branch) -> int:
    return 1 if branch.elbow == "up" else -1


def _in_turn(limits: Interval, angle: float, hint: float) -> float:
    if abs(hint - angle) <= math.pi:
        return angle
    turned = angle + math.tau * round((hint - angle) / math.tau)
    return turned if limits.lower <= turned <= limits.upper else angle


def _bends(theta3: Interval, bend: int) -> list[tuple[int, Interval]]:
    """Return the parts of `theta3` on one side of the stretched and of the folded arm."""
    if theta3 == ANY_ANGLE:
        theta3 = Interval(-math.pi, math.pi)
    half_turns = range(math.floor(theta3.lower / math.pi), math.ceil(theta3.upper / math.pi))
    return [
        (bend, Interval(max(theta3.lower, k * math.pi), min(theta3.upper, (k + 1) * math.pi)))
        for k in half_turns
        if (k % 2 == 0) == (bend > 0)
    ]


def _least_bend(theta3: Interval, bend: int) -> list[tuple[int, Interval]]:
    """Return the end of `theta3` nearest to an elbow that the limits exclude."""
    end = min(theta3, key=lambda theta: abs(math.sin(theta)))
    return [(bend, Interval(end, end))]
