"""The scene around the arm when the server starts."""

from __future__ import annotations

from typing import NamedTuple

from katana450.arm.control.commands import commands as cmd
from katana450.arm.robot.object_meshes import Mesh
from katana450.maths.geometry.arrays import FloatArray


class InitialScene(NamedTuple):
    """A scene in place of the robot's own.

    Attributes:
        command: Places its objects and its water.
        joints: (n,) initial joint angles [rad]; None for the ready posture.
        meshes: Meshes of its objects.
    """

    command: cmd.ReplaceScene
    joints: FloatArray | None
    meshes: tuple[Mesh, ...]
