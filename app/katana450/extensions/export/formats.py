"""Table of the export formats: one row each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple


class ExportFormat(NamedTuple):
    """A row of the table.

    Attributes:
        help: description for the help of the command.
        posed: whether it is written at a pose.
        scene: whether it has the objects of a new server, and a Switch for each shape.
        moves: whether it is a page, a single file that plays a motion.
    """

    help: str
    posed: bool = False
    scene: bool = False
    moves: bool = False


FORMATS: Mapping[str, ExportFormat] = {
    "vrml": ExportFormat(
        "a VRML97 world and one file per part, for LabVIEW, Simulink and X3D browsers",
        posed=True,
        scene=True,
    ),
    "x3d": ExportFormat("the same world as X3D in XML", posed=True, scene=True),
    "c": ExportFormat(
        "C arrays and a draw function per link, kinematics, and an OpenGL viewer", posed=True
    ),
    "glb": ExportFormat("binary glTF 2.0, for browsers, Blender and game engines", posed=True),
    "urdf": ExportFormat("a zip of a ROS 2 package of URDF and meshes"),
    "mjcf": ExportFormat("a zip of a MuJoCo model with actuators, sites, keyframes and its meshes"),
    "html": ExportFormat(
        "a page that plays a run, with a time slider; it needs no server", posed=True, moves=True
    ),
}
"""The formats by their names."""


def named(trait: Callable[[ExportFormat], bool]) -> list[str]:
    """Return the names of the formats of which ``trait`` is true."""
    return [name for name, row in FORMATS.items() if trait(row)]
