"""The choice of the planning of a hand, by the kinematics of its arm."""

from __future__ import annotations

from typing import Final

from katana450.arm.control.session import Session
from katana450.errors import InputError
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.programs.family_hand import FamilyHand
from katana450.extensions.programs.five_axis_hand import FiveAxisHand
from katana450.extensions.programs.grasp_frame import grasp_frame
from katana450.extensions.programs.hand_planning import HandPlanning
from katana450.extensions.programs.planar_hand import PlanarHand
from katana450.extensions.programs.pose_hand import PoseHand
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray, frozen

FREE_AXES: Final = 6
"""Minimum number of axes with which a hand takes every pose."""

PLANAR_AXES: Final = 4
"""Number of axes with which it takes every place and pitch."""


def hand_of(session: Session, T_base_shoulder: FloatArray, tool: str) -> HandPlanning:
    """Return the hand of the arm of ``session`` with ``tool``.

    ``T_base_shoulder``: (4, 4) pose of {S} in the base frame [m]. Raises InputError, with the
    reason, for an arm that cannot grasp.
    """
    arm, environment = session.require_arm(), session.environment
    kinematics = arm.kinematics_to(tool)
    in_family = not isinstance(kinematics, DrivenTool)
    if in_family and FiveAxisHand.tool in arm.tools:
        return FiveAxisHand(kinematics.chain, T_base_shoulder)
    axes = arm.chain.n
    if not in_family and axes < FREE_AXES and axes != PLANAR_AXES:
        raise InputError(
            f"An arm with {axes} axes outside the five-axis family cannot keep an object upright. "
            "Objects are grasped by arms with four axes, with six or more, and by the five-axis "
            "family."
        )
    hand = environment.hand
    frame = grasp_frame(environment.world(()), hand, arm.gripper)
    assert hand is not None
    T_palm_tool = hand.T_palm_tool @ se3.inverse(arm.tools[arm.default_tool]) @ arm.tools[tool]
    T_tool_grasp = frozen(se3.inverse(T_palm_tool) @ frame.T_palm_grasp)
    if not isinstance(kinematics, DrivenTool):
        return FamilyHand.of(kinematics.chain, T_base_shoulder, T_tool_grasp, frame)
    if axes == PLANAR_AXES:
        return PlanarHand.of(kinematics, T_base_shoulder, T_tool_grasp, frame, session.ready)
    return PoseHand(kinematics, T_base_shoulder, T_tool_grasp, frame.opening, one_jaw=frame.one_jaw)
