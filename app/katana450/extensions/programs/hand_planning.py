"""The interface between the steps that grasp and place, and the hand of an arm.

A step is written once, in terms of this interface. `FiveAxisHand` gives it pitch and roll of the
five-axis family, `FamilyHand` the same for the grasp frame of its fingers, `PoseHand` and
`PlanarHand` poses of the grasp frame of any other hand. `FrameHand` is what these three share.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from katana450.arm.control.scene_objects import SceneObject
from katana450.extensions.general_arms.tool_pose import ToolPose
from katana450.extensions.programs.approach import Approach
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.kinematics.branch import AnyBranch
from katana450.maths.kinematics.tool import DragTarget, ToolTarget


class HandPlanning(Protocol):
    """The hand of one arm with one tool. Joint angles ``q`` are (n,) [rad], points (3,) [m] in {S}.

    Attributes:
        tool: name of the tool frame that grasps; "" for every one.
        tip_distances: distances [m] of the tool before the middle of an object that is grasped by
            the fingertips, in the order in which they are tried.
        is_redundant: whether the arm takes a pose in a curve of postures.
    """

    @property
    def tool(self) -> str: ...  # noqa: D102

    @property
    def tip_distances(self) -> Sequence[float]: ...  # noqa: D102

    @property
    def is_redundant(self) -> bool: ...  # noqa: D102

    def approaches(
        self, scene_object: SceneObject, at: FloatArray, side: FloatArray
    ) -> Mapping[str, Sequence[Approach]]:
        """Return the approaches that suit an object, by side, the preferred side first.

        The object stands at ``at`` (3,) [m] with its x axis along ``side`` (3,), both in {S}.
        Raises InputError for an object that does not fit between the fingers.
        """

    def with_pitch(
        self, pitch: float, scene_object: SceneObject, at: FloatArray, side: FloatArray
    ) -> Sequence[Approach]:
        """Return the approaches with ``pitch`` [rad]; see ``approaches``."""

    def before(self, middle: FloatArray, approach: Approach, back: float) -> DragTarget:
        """Return the tool at which the hand is ``back`` [m] before ``middle`` (3,) [m]."""

    def drawn_back(self, q: FloatArray, away: float) -> DragTarget:
        """Return the tool at `q`, drawn back by ``away`` [m] along its own axis."""

    def retreat(self, q: FloatArray, away: float) -> DragTarget:
        """Return the tool with which the hand leaves an object that it released at `q`.

        It is drawn back by ``away`` [m] and, for a fixed jaw, moved by JAW_ROOM along -y of the
        grasp frame, so that this jaw leaves the object.
        """

    def branches_to(self, q: FloatArray, target: DragTarget) -> Sequence[AnyBranch | None]:
        """Return the branches on which a grasp at ``target`` is tried, that of `q` first.

        None is the nearest one. The result is empty if ``target`` is out of reach.
        """

    def branch_at(self, q: FloatArray) -> AnyBranch | None:
        """Return the branch on which an approach to `q` begins; None for any."""

    def way_round(self, here: float, there: float) -> float:
        """Return the turn [rad] about axis 1 by which an object is carried between directions."""

    def turned(self, target: DragTarget, position: FloatArray, angle: float) -> DragTarget:
        """Return ``target`` turned by ``angle`` [rad] about the vertical, to ``position`` (3,)."""

    def over(
        self,
        held: SceneObject,
        T_base_object: FloatArray,
        q: FloatArray,
        goal: FloatArray,
        yaw: float | None,
    ) -> Sequence[DragTarget]:
        """Return the tools that hold an object over ``goal`` (3,) [m], the best first.

        Args:
            held: the object in the hand.
            T_base_object: (4, 4) its present pose in the base frame.
            q: the present posture.
            goal: the place of its underside.
            yaw: its angle about the vertical in the base frame [rad]; None for any.

        Raises InputError for a ``yaw`` to which this hand cannot turn it.
        """


def difference(one: DragTarget, other: DragTarget) -> float:
    """Return the largest difference [m or rad] of two targets of one arm."""
    if isinstance(one, ToolTarget) and isinstance(other, ToolTarget):
        apart = float(np.abs(one.position - other.position).max())
        return max(apart, abs(one.pitch - other.pitch), abs(one.roll - other.roll))
    assert isinstance(one, ToolPose)
    assert isinstance(other, ToolPose)
    return max(one.apart(other))
