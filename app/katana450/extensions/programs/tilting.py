"""The turn of a held cup over a basin: about the axis of the tool, or about the lip of the cup."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.approach import UP
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.pose_curve import PoseTurn
from katana450.extensions.programs.tool_planning import AnyCurve, ToolPlanning
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen

EMPTY_TILT: Final = math.radians(120.0)
"""[rad] Tilt of a cup that is emptied: past its side."""

UNDERSIDES: Final = (0.02, 0.05, 0.09)
"""[m] Heights of the upright cup over the basin's rim, tried in this order."""

SIDES: Final = tuple(np.radians((90.0, -90.0, 45.0, -45.0, 0.0)).tolist())
"""[rad] Directions in which a cup is tilted, seen from above, from that in which the hand points.
Beside the hand the wrist does most of the turn.
"""


@dataclass(frozen=True, eq=False)
class Tilting:
    """The motions that empty a cup.

    Attributes:
        at: the tool with the cup upright over the basin.
        lip: the lip about which the cup tilts.
        planning: of the tool.
    """

    at: ToolPose
    lip: Lip
    planning: ToolPlanning

    def arc(self, angle: float, start: float, end: float) -> AnyCurve:
        """Return the turn by ``angle`` [rad] from the tilt ``start`` to ``end`` [rad]."""
        one, other = (
            self.at if not tilt else self.lip.turned(self.at, tilt) for tilt in (start, end)
        )
        return self.planning.arc(self.lip.point, self.lip.axis, angle, 0.0, one, other)

    def by(self, tilts: FloatArray) -> AnyCurve:
        """Return the turn by a polynomial; ``tilts``: see `PoseTurn`."""
        return PoseTurn(self.at, self.lip.point, self.lip.axis, tilts)


@dataclass(frozen=True, eq=False)
class Lip:
    """The lip of a cup in the hand of an arm with six or more axes, and the axis along it.

    Attributes:
        point: (3,) [m] in {S}.
        axis: unit vector (3,), level, about which the cup tilts.
    """

    point: FloatArray
    axis: FloatArray

    def turned(self, pose: ToolPose, angle: float) -> ToolPose:
        """Return ``pose``, turned by ``angle`` [rad] about the axis."""
        R = so3.exp(angle * self.axis)
        return ToolPose(frozen(self.point + R @ (pose.position - self.point)), frozen(R @ pose.R))


def about_the_lip(
    builder: PlanBuilder,
    cup: FloatArray,
    size: tuple[float, float],
    over: FloatArray,
) -> Iterator[Tilting]:
    """Yield the ways to tilt an upright cup about its lip, the best first.

    Args:
        builder: the arm, with six or more axes, which holds the cup.
        cup: (3,) the middle of the cup's rim [m] in {S}, at the present posture.
        size: radius of the rim, and height of the cup [m].
        over: (3,) the middle of the basin's rim [m] in {S}.
    """
    level, hand, planning = builder.target, builder.hand, builder.planning
    here, there = (math.atan2(p[1], p[0]) for p in (cup, over))
    natural = hand.way_round(here, there)
    x, y, _ = level.position - hand.drawn_back(builder.q, 1.0).position
    ahead = math.atan2(y, x)
    radius, tall = size
    for height in UNDERSIDES:
        for side in SIDES:
            # The cup turns with the arm on the way to the basin.
            toward = so3.rotation_z(ahead + natural + side)[:, 0]
            lip = Lip(frozen(over + (tall + height) * UP), frozen(np.cross(UP, toward)))
            middle = lip.point - radius * toward
            moved = middle + so3.rotation_z(natural) @ (level.position - cup)
            at = hand.turned(level, moved, natural)
            assert isinstance(at, ToolPose)
            yield Tilting(at, lip, planning)
