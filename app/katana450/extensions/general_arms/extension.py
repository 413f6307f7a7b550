"""The kinematics of arms outside the five-axis family as an extension."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension

if TYPE_CHECKING:
    from katana450.arm.control.tool_kinematics import ArmKinematics
    from katana450.maths.kinematics.chain import Chain
    from katana450.server.view.gizmo import Gizmo

ALL_FREEDOMS = 6
"""Number of freedoms of a tool that can have every orientation."""

LEAST_AXES = 3
"""Minimum number of axes of an arm that is driven by its tool: fewer reach no volume."""


def _kinematics(chain: Chain) -> ArmKinematics | None:
    from katana450.arm.control.tool_kinematics import ArmKinematics
    from katana450.extensions.general_arms.choice import exact_arm, kinematics_of
    from katana450.extensions.general_arms.driven_tool import DrivenTool

    if chain.n < LEAST_AXES:
        return None
    exact, notes = exact_arm(chain)
    method = f"The kinematics are {kinematics_of(exact).method}."
    return ArmKinematics(exact, DrivenTool, (*notes, method))


def _gizmo(freedoms: int) -> type[Gizmo] | None:
    from katana450.extensions.general_arms.pose_gizmo import PoseGizmo

    return PoseGizmo if freedoms == ALL_FREEDOMS else None


EXTENSION = Extension("general_arms", kinematics=_kinematics, gizmo=_gizmo)
