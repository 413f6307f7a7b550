"""The hand of any arm outside the five-axis family that takes whole poses: six or more axes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple, cast

import numpy as np

from katana450.arm.control.scene_objects import SceneObject
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.approach import Approach, symmetry
from katana450.extensions.programs.frame_hand import FrameHand
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.tool import DragTarget
from katana450.maths.kinematics.turns import wrapped

PITCHES: Final = tuple(np.radians((45.0, 25.0, 65.0)).tolist())
"""[rad] Pitches of the hand for a grasp from the front, tried in this order."""

SWINGS: Final = tuple(np.radians((-30.0, 30.0, -60.0, 60.0)).tolist())
"""[rad] Turns of the swivel of seven axes with which a pose is tried."""

MAX_BRANCHES: Final = 4
"""Maximum number of branches on which a grasp is tried."""

TILT_DIRECTIONS: Final = tuple(np.radians((90.0, -90.0, 45.0, -45.0, 0.0)).tolist())
"""[rad] Directions in which a cup is tilted, seen from above, from that in which the hand points.
Beside the hand the wrist does most of the turn.
"""

TURNS: Final = tuple(np.radians((45.0, -45.0, 90.0, -90.0, 180.0)).tolist())
"""[rad] Further turns of an object over its new place, beside those with the arm and without."""


class TiltDirection(NamedTuple):
    """A direction in which a held cup is tilted over a place.

    Attributes:
        turn: turn about axis 1 that brings the cup there [rad].
        toward: (3,) unit vector, level, from the middle of the rim to the lip, in {S}.
        in_pose: the same in the frame of the rotation of a `ToolPose`.
    """

    turn: float
    toward: FloatArray
    in_pose: FloatArray


@dataclass(frozen=True, eq=False)
class PoseHand(FrameHand):
    """The hand of one arm as `HandPlanning`.

    Attributes:
        kinematics: the arm with its tool.
        T_base_shoulder: (4, 4) pose of {S} in the base frame [m].
        T_tool_grasp: (4, 4) pose of the grasp frame in that of the tool [m].
        opening: distance between the open fingers [m].
        one_jaw: whether one jaw closes against a fixed one.
    """

    kinematics: DrivenTool
    T_base_shoulder: FloatArray
    T_tool_grasp: FloatArray
    opening: float
    one_jaw: bool = False

    pitches: ClassVar[Sequence[float]] = PITCHES

    @property
    def is_redundant(self) -> bool:
        """True if it has more than six axes."""
        return self.kinematics.chain.n > 6

    def before(self, middle: FloatArray, approach: Approach, back: float) -> DragTarget:
        """Return the tool with the grasp frame before ``middle``, on its own x axis."""
        yaw = math.atan2(middle[1], middle[0]) + approach.aside
        R = so3.from_rpy(approach.roll, approach.pitch, yaw)
        return self._tool(R, middle - back * R[:, 0] - approach.shift * R[:, 1])

    def _tool(self, R: FloatArray, p: FloatArray) -> ToolPose:
        """Return the tool that brings the grasp frame to rotation `R` (3, 3) and point `p` (3,)."""
        T = se3.from_rotation_translation(R, p) @ se3.inverse(self.T_tool_grasp)
        return ToolPose.of(T)

    def _at(self, q: FloatArray) -> ToolPose:
        """Return the pose of the tool at `q`."""
        return self.kinematics.target_at(q)

    def _R(self, q: FloatArray) -> FloatArray:
        """Return the rotation (3, 3) of the grasp frame in {S} at `q`."""
        return np.asarray(forward(self.kinematics.chain, q)[:3, :3] @ self.T_tool_grasp[:3, :3])

    def branches_to(self, q: FloatArray, target: DragTarget) -> Sequence[AnyBranch | None]:
        """Return those with a posture inside the limits that takes the pose."""
        return self._branches_to(q, cast(ToolPose, target).T)

    def _branches_to(self, q: FloatArray, T: FloatArray) -> Sequence[AnyBranch | None]:
        """Return the branches with a posture for the tool at `T` (4, 4)."""
        here, hints = self.kinematics.branch_of(q), [q]
        for axis in self.kinematics.equations(q).locked[:1]:
            # The swivel of the posture there may be another one.
            chain, unit = self.kinematics.chain, np.eye(len(q))[axis]
            hints += [chain.clamp(q + swing * unit) for swing in SWINGS]
        for hint in hints:
            postures = [p for p in self.kinematics.inverse(T, hint) if p.exact and p.within_limits]
            if postures:
                names = sorted((str(p.branch) for p in postures), key=lambda each: each != here)
                return [*dict.fromkeys(names)][:MAX_BRANCHES]
        return []

    def branch_at(self, q: FloatArray) -> AnyBranch | None:
        """Return the branch of `q`: the line to it keeps to its branch."""
        return self.kinematics.branch_of(q)

    def way_round(self, here: float, there: float) -> float:
        """Return the shorter way."""
        return wrapped(there - here)

    def tilt_directions(
        self, q: FloatArray, cup: FloatArray, over: FloatArray
    ) -> Iterable[TiltDirection]:
        """Yield the directions in which a cup can be tilted with its lip over a place.

        Args:
            q: the present posture.
            cup: (3,) the present middle of its rim [m] in {S}.
            over: (3,) the place of the lip [m] in {S}.
        """
        here, there = (math.atan2(p[1], p[0]) for p in (cup, over))
        turn = self.way_round(here, there)
        x, y, _ = self._R(q)[:, 0]
        for aside in TILT_DIRECTIONS:
            toward = so3.rotation_z(math.atan2(y, x) + turn + aside)[:, 0]
            yield TiltDirection(turn, toward, toward)

    def turned(self, target: DragTarget, position: FloatArray, angle: float) -> DragTarget:
        """Return the pose, turned as one rigid body."""
        return ToolPose(frozen(position), frozen(so3.rotation_z(angle) @ cast(ToolPose, target).R))

    def over(
        self,
        held: SceneObject,
        T_base_object: FloatArray,
        q: FloatArray,
        goal: FloatArray,
        yaw: float | None,
    ) -> Sequence[DragTarget]:
        """Return the tools: the object turns with the arm, or as requested."""
        T = se3.inverse(self.T_base_shoulder) @ T_base_object
        here, there = (math.atan2(p[1], p[0]) for p in (T[:3, 3], goal))
        natural = self.way_round(here, there)
        now = math.atan2(T_base_object[1, 0], T_base_object[0, 0])
        alike = symmetry(held)
        if yaw is None or alike == 0.0:
            turns = [natural, 0.0, *(wrapped(natural + each) for each in TURNS)]
        else:
            first = natural + math.remainder(yaw - now - natural, alike)
            turns = sorted(
                (wrapped(first + k * alike) for k in range(round(math.tau / alike))),
                key=lambda turn: abs(wrapped(turn - natural)),
            )
        tools = [self._carried(q, T[:3, 3], goal, turn) for turn in turns]
        return [tool for tool in tools if self.branches_to(q, tool)] or tools[:1]

    def _carried(self, q: FloatArray, p: FloatArray, goal: FloatArray, turn: float) -> ToolPose:
        """Return the tool at `q`, turned with an object at `p` (3,) so that it is at ``goal``."""
        at, R = self.kinematics.target_at(q), so3.rotation_z(turn)
        return ToolPose(frozen(goal + R @ (at.position - p)), frozen(R @ at.R))
