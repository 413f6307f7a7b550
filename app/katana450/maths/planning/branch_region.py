"""The joint angles of one branch, and whether a straight joint line stays among them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.arm import Five, arm_of
from katana450.maths.kinematics.branch import Branch
from katana450.maths.kinematics.chain import Chain

EDGE: Final = 1e-10
"""Distance [m] beyond the edge of a branch, or sine [1] of the elbow, that is only rounding."""

MAX_PIECES: Final = 4000
"""Maximum number of pieces of a line. A line along the edge needs more and is rejected."""


@dataclass(frozen=True)
class BranchRegion:
    """The postures of `chain` on `branch`, with its edges."""

    chain: Chain
    branch: Branch

    def holds(self, q: FloatArray) -> bool:
        """Return True if the posture `q` (5,) [rad] is on the branch."""
        alpha = arm_of(self.chain).angles(q)
        return self._outward(alpha) >= -EDGE and self._bend(alpha[2]) >= -EDGE

    def holds_line(self, a: FloatArray, b: FloatArray) -> bool:
        """Return True if every posture on the line from `a` to `b` (5,) [rad] is on the branch.

        The result is proven, not sampled. Between two places at a distance h the outward distance
        is at least the smaller of its two values, less h^2 / 8 times the maximum of its second
        derivative.
        """
        arm = arm_of(self.chain)
        start, end = arm.angles(a), arm.angles(b)
        if not self._holds_elbow(start[2], end[2]):
            return False
        curvature = self._curvature(a, b) / 8.0

        def at(s: float) -> float:
            one, two, three, four, five = (x + s * (y - x) for x, y in zip(start, end, strict=True))
            return self._outward((one, two, three, four, five))

        pieces = [(0.0, at(0.0), 1.0, at(1.0))]
        if min(pieces[0][1], pieces[0][3]) < -EDGE:
            return False
        for _ in range(MAX_PIECES):
            if not pieces:
                return True
            low, low_value, high, high_value = pieces.pop()
            if min(low_value, high_value) - curvature * (high - low) ** 2 >= -EDGE:
                continue
            middle = 0.5 * (low + high)
            value = at(middle)
            if value < -EDGE:
                return False
            pieces += [(low, low_value, middle, value), (middle, value, high, high_value)]
        return False

    def holds_corner(self, a: FloatArray, via: FloatArray, b: FloatArray) -> bool:
        """Return True if a rounded corner at `via` from `a` to `b` (5,) [rad] is on the branch.

        The corner is anywhere in the triangle of the three postures. The bound is the same as for
        a line, with half the square of the longest side.
        """
        if not (self.holds(a) and self.holds(via) and self.holds(b)):
            return False
        arm = arm_of(self.chain)
        lowest = min(self._outward(arm.angles(q)) for q in (a, via, b))
        sides = ((a, via), (via, b), (a, b))
        return lowest - 0.5 * max(self._curvature(*side) for side in sides) >= -EDGE

    def _curvature(self, a: FloatArray, b: FloatArray) -> float:
        """Return the maximum second derivative [m] of the outward distance from `a` to `b`."""
        arm = arm_of(self.chain)
        _, d2, d3, d4, _ = (y - x for x, y in zip(arm.angles(a), arm.angles(b), strict=True))
        return arm.l1 * d2**2 + arm.l2 * (d2 + d3) ** 2 + arm.l3 * (d2 + d3 + d4) ** 2

    def _holds_elbow(self, start: float, end: float) -> bool:
        """Return True if axis 3 keeps its side all the way between two canonical angles [rad]."""
        middle = 0.5 * (start + end)
        # Both ends are in the same half turn, which begins at a multiple of pi.
        for half in {math.floor((middle + side) / math.pi) for side in (-EDGE, EDGE)}:
            low, high = half * math.pi - EDGE, (half + 1) * math.pi + EDGE
            inside = low <= min(start, end) and max(start, end) <= high
            if inside and (half % 2 == 0) == (self.branch.elbow == "up"):
                return True
        return False

    def _outward(self, alpha: Five) -> float:
        """Return the distance [m] of {K} from axis 1, positive on the side of the branch."""
        arm = arm_of(self.chain)
        _, two, three, four, _ = alpha
        r = (
            arm.a
            + arm.l1 * math.cos(two)
            + arm.l2 * math.cos(two + three)
            + arm.l3 * math.cos(two + three + four)
        )
        return r if self.branch.shoulder == "front" else -r

    def _bend(self, alpha3: float) -> float:
        return math.sin(alpha3) if self.branch.elbow == "up" else -math.sin(alpha3)
