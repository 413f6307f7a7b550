"""The arm outside the five-axis family in a URDF, if a server can drive its tool."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from katana450.arm.robot.arm_reader import OtherArm, described_chain
from katana450.arm.robot.structure import structure_of
from katana450.arm.robot.urdf import Urdf
from katana450.errors import RobotDescriptionError
from katana450.extensions.general_arms.choice import exact_arm, kinematics_of
from katana450.extensions.general_arms.driven_tool import DrivenTool

LEAST_AXES: Final = 3
"""Minimum number of axes of an arm that is driven by its tool: fewer reach no volume."""


def found_arm(urdf: Urdf, path: Path, tool: str | None) -> OtherArm | None:
    """Return the arm with ``tool``, or any, in the description ``urdf`` of the file ``path``.

    None if there is no such arm, or if joints beside it could then no longer be driven. Raises
    RobotDescriptionError if there is one, and its axes or limits are described wrongly.
    """
    try:
        structure = structure_of(urdf, path, tool, count=None)
    except RobotDescriptionError:
        return None
    beside = any(joint.mimic is None for joint in structure.others)
    if len(structure.axes) < LEAST_AXES or (tool is None and beside):
        return None
    described, T_base_shoulder = described_chain(urdf.frames(), structure)
    chain, notes = exact_arm(described)
    method = f"The kinematics are {kinematics_of(chain).method}."
    return OtherArm(structure, T_base_shoulder, chain, DrivenTool, (*notes, method))
