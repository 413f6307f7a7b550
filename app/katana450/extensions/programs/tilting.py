"""The turn of a held cup over a basin: about the axis of the tool, or about the lip of the cup."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.approach import UP
from katana450.extensions.programs.plan_builder import PlanBuilder
from katana450.extensions.programs.tool_planning import AnyCurve
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.tool import DragTarget

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
        down: the curve that tilts it.
        shake: the curves of one shake; empty without.
        back: the curve that turns it back.
    """

    at: DragTarget
    down: AnyCurve
    shake: Sequence[AnyCurve]
    back: AnyCurve


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
    tilt: float,
    shake: float,
) -> Iterator[Tilting]:
    """Yield the ways to tilt an upright cup about its lip, the best first.

    Args:
        builder: the arm, with six or more axes, which holds the cup.
        cup: (3,) the middle of the cup's rim [m] in {S}, at the present posture.
        size: radius of the rim, and height of the cup [m].
        over: (3,) the middle of the basin's rim [m] in {S}.
        tilt: of the cup [rad].
        shake: the angle of a shake [rad]; 0 for none.
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
            down, up = lip.turned(at, tilt), lip.turned(at, tilt - shake)

            def arc(angle: float, start: ToolPose, end: ToolPose, lip: Lip = lip) -> AnyCurve:
                return planning.arc(lip.point, lip.axis, angle, 0.0, start, end)

            yield Tilting(
                at,
                arc(tilt, at, down),
                (arc(-shake, down, up), arc(shake, up, down)) if shake else (),
                arc(-tilt, down, at),
            )
