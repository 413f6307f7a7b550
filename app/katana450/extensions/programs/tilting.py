"""The turn of a held vessel about its lip, over a basin or another vessel."""

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
"""[m] Heights of the upright cup over the rim below it, tried in this order."""

AIM: Final = 0.015
"""[m] Distance of the lip before the middle of another vessel: as far as the water flies while it
falls, with the flows of a pour.
"""


@dataclass(frozen=True, eq=False)
class Tilting:
    """The motions that tilt a cup about its lip.

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

    def by(self, coefficients: FloatArray) -> AnyCurve:
        """Return the turn whose tilt is a polynomial of ``coefficients`` (n,); see `PoseTurn`."""
        lip = self.lip
        return PoseTurn(self.at, lip.point, lip.axis, coefficients, lip.axis_in_pose)


@dataclass(frozen=True, eq=False)
class Lip:
    """The lip of a cup in the hand of an arm outside the five-axis family, and the axis along it.

    Attributes:
        point: (3,) [m] in {S}.
        axis: unit vector (3,), level, about which the cup tilts.
        axis_in_pose: the same in the frame of the rotation of a `ToolPose`.
    """

    point: FloatArray
    axis: FloatArray
    axis_in_pose: FloatArray

    def turned(self, pose: ToolPose, angle: float) -> ToolPose:
        """Return ``pose``, turned by ``angle`` [rad] about the axis."""
        position = self.point + so3.exp(angle * self.axis) @ (pose.position - self.point)
        return ToolPose(frozen(position), frozen(so3.exp(angle * self.axis_in_pose) @ pose.R))


def about_the_lip(
    builder: PlanBuilder,
    cup: FloatArray,
    size: tuple[float, float],
    over: FloatArray,
    aim: float = 0.0,
) -> Iterator[Tilting]:
    """Yield the ways to tilt an upright cup about its lip, the best first.

    Args:
        builder: the arm, outside the five-axis family, which holds the cup.
        cup: (3,) the middle of the cup's rim [m] in {S}, at the present posture.
        size: radius of the rim, and height of the cup [m].
        over: (3,) the middle of the rim below [m] in {S}.
        aim: distance of the lip before that middle [m].
    """
    level, hand = builder.target, builder.hand
    radius, tall = size
    for height in UNDERSIDES:
        point = over + (tall + height) * UP
        for turn, toward, in_pose in hand.tilt_directions(builder.q, cup, point):
            place = point - aim * toward
            lip = Lip(frozen(place), *(frozen(np.cross(UP, d)) for d in (toward, in_pose)))
            # The cup turns with the arm on the way to the basin.
            moved = so3.rotation_z(turn) @ (level.position - cup)
            at = hand.turned(level, place - radius * toward + moved, turn)
            assert isinstance(at, ToolPose)
            yield Tilting(at, lip, builder.planning)
