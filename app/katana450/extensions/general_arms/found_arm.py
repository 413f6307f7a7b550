"""The arm outside the five-axis family in a URDF: to solve its poses, or to drive its tool too."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from katana450.arm.robot.arm_reader import OtherArm, described_chain
from katana450.arm.robot.structure import Structure, structure_of
from katana450.arm.robot.urdf import Urdf
from katana450.errors import RobotDescriptionError
from katana450.extensions.general_arms.choice import exact_arm, kinematics_of
from katana450.extensions.general_arms.driven_tool import DrivenTool

SOLVED_AXES: Final = 2
"""Minimum number of axes: {S} lies where axis 1 passes axis 2."""

DRIVEN_AXES: Final = 3
"""Minimum number of axes of an arm that is driven by its tool: fewer reach no volume."""


def solved_arm(urdf: Urdf, path: Path, tool: str | None) -> OtherArm | None:
    """Return the arm with ``tool``, or any, in the description ``urdf`` of the file ``path``.

    None if there is none. Raises RobotDescriptionError if there is one, and its axes or limits are
    described wrongly.
    """
    structure = _structure(urdf, path, tool, SOLVED_AXES)
    return None if structure is None else _arm(urdf, structure)


def driven_arm(urdf: Urdf, path: Path, tool: str | None) -> OtherArm | None:
    """Return `solved_arm` if a server can drive its tool.

    None also if joints beside the arm could then no longer be driven.
    """
    structure = _structure(urdf, path, tool, DRIVEN_AXES)
    if structure is None or (tool is None and any(j.mimic is None for j in structure.others)):
        return None
    return _arm(urdf, structure)


def _structure(urdf: Urdf, path: Path, tool: str | None, axes: int) -> Structure | None:
    try:
        structure = structure_of(urdf, path, tool, count=None)
    except RobotDescriptionError:
        return None
    return structure if len(structure.axes) >= axes else None


def _arm(urdf: Urdf, structure: Structure) -> OtherArm:
    described, T_base_shoulder = described_chain(urdf.frames(), structure)
    chain, notes = exact_arm(described)
    method = f"The kinematics are {kinematics_of(chain).method}."
    return OtherArm(structure, T_base_shoulder, chain, DrivenTool, (*notes, method))
