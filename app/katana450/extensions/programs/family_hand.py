"""The hand of the five-axis family where the description has no frame ``grasp``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from katana450.arm.control.scene_objects import SceneObject
from katana450.errors import InputError
from katana450.extensions.programs.approach import FRONT, Approach
from katana450.extensions.programs.fitting import Widths, widths
from katana450.extensions.programs.five_axis_hand import (
    MAX_SKEW,
    PITCHES,
    STEEP_PITCHES,
    FiveAxisHand,
)
from katana450.extensions.programs.frame_hand import FrameHand
from katana450.extensions.programs.grasp_frame import GraspFrame
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.arm import arm_of
from katana450.maths.kinematics.branch import BRANCHES
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import ToolTarget
from katana450.maths.kinematics.turns import wrapped

MAX_BEND: Final = math.radians(10.0)
"""[rad] Maximum angle between the fingers and the roll axis, along which the hand approaches."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FamilyHand(FrameHand, FiveAxisHand):
    """The hand of one chain as `HandPlanning`, which grasps by the frame of its fingers.

    Attributes:
        T_tool_grasp: (4, 4) pose of the grasp frame in that of the tool [m].
        opening: distance between the open fingers [m].
        one_jaw: whether one jaw closes against a fixed one.
        roll: roll of the tool at which the fingers close horizontally [rad].
    """

    T_tool_grasp: FloatArray
    opening: float
    one_jaw: bool
    roll: float

    pitches: ClassVar[Sequence[float]] = (*PITCHES, *STEEP_PITCHES)

    @staticmethod
    def of(
        chain: Chain, T_base_shoulder: FloatArray, T_tool_grasp: FloatArray, frame: GraspFrame
    ) -> FamilyHand:
        """Return the hand. Raises InputError if its fingers do not point along the roll axis."""
        R = (arm_of(chain).T_K_tool @ T_tool_grasp)[:3, :3]
        bend = math.acos(min(max(float(R[0, 0]), -1.0), 1.0))
        if bend > MAX_BEND:
            raise InputError(
                "The hand of five axes grasps along its roll axis, and its fingers point "
                f"{math.degrees(bend):.0f} deg beside it; the maximum is "
                f"{math.degrees(MAX_BEND):.0f} deg."
            )
        return FamilyHand(
            chain,
            T_base_shoulder,
            T_tool_grasp=T_tool_grasp,
            opening=frame.opening,
            one_jaw=frame.one_jaw,
            roll=-math.atan2(R[2, 1], R[1, 1]),
        )

    def _options(
        self, pitches: Sequence[float], scene_object: SceneObject, at: FloatArray, side: FloatArray
    ) -> Widths:
        """Return those of which yaw and roll follow from the arm."""
        options = widths(pitches, scene_object, at, side)
        # The fixed jaw may be on either side.
        rolls = (0.0, math.pi) if self.one_jaw else (0.0,)
        options[FRONT] = [
            (Approach(approach.pitch, roll), width)
            for approach, width in options.get(FRONT, ())
            for roll in rolls
            if abs(approach.aside) <= MAX_SKEW
        ]
        return options

    def before(self, middle: FloatArray, approach: Approach, back: float) -> ToolTarget:
        """Return the tool with the grasp frame before ``middle``, in the plane of the arm."""
        inside = np.array((back, approach.shift, 0.0))
        T = self.T_tool_grasp @ se3.from_rotation_translation(np.eye(3), inside)
        chain = self.chain.with_tool(self.chain.M @ T)
        at = ToolTarget(middle, approach.pitch, wrapped(approach.roll + self.roll))
        pose = at.pose(chain, at.facing(chain, BRANCHES[0], 0.0)) @ se3.inverse(T)
        return at.moved(frozen(pose[:3, 3]))

    def _at(self, q: FloatArray) -> ToolTarget:
        """Return the target of the tool at `q` (5,) [rad]."""
        return ToolTarget.at(self.chain, q)

    def _R(self, q: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) of the grasp frame in {S} at `q` (5,) [rad]."""
        return np.asarray(forward(self.chain, q)[:3, :3] @ self.T_tool_grasp[:3, :3])
