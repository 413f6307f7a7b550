"""The kinematics of arms outside the five-axis family as an extension."""

from __future__ import annotations

from typing import TYPE_CHECKING

from katana450.extension import Extension

if TYPE_CHECKING:
    from pathlib import Path

    from katana450.arm.robot.arm_reader import OtherArm
    from katana450.arm.robot.urdf import Urdf
    from katana450.server.view.gizmo import Gizmo

ALL_FREEDOMS = 6
"""Number of freedoms of a tool that can have every orientation."""


def _find_arm(urdf: Urdf, path: Path, tool: str | None) -> OtherArm | None:
    from katana450.extensions.general_arms.found_arm import found_arm

    return found_arm(urdf, path, tool)


def _gizmo(freedoms: int) -> type[Gizmo] | None:
    from katana450.extensions.general_arms.pose_gizmo import PoseGizmo

    return PoseGizmo if freedoms == ALL_FREEDOMS else None


EXTENSION = Extension("general_arms", find_arm=_find_arm, gizmo=_gizmo)
