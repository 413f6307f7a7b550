"""The choice of the planning of a tool, by its kinematics."""

from __future__ import annotations

from katana450.arm.control.tool_kinematics import ToolKinematics
from katana450.extensions.general_arms.driven_tool import DrivenTool
from katana450.extensions.programs.five_axis_planning import FiveAxisPlanning
from katana450.extensions.programs.pose_planning import PosePlanning
from katana450.extensions.programs.tool_planning import ToolPlanning


def planning_of(kinematics: ToolKinematics) -> ToolPlanning:
    """Return the planning of the tool of ``kinematics``."""
    if isinstance(kinematics, DrivenTool):
        return PosePlanning(kinematics)
    return FiveAxisPlanning(kinematics)
