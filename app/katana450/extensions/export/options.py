"""Options of ``katana450 export``, and the table of its formats: one row each."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from katana450.cli.option_values import add_arm_options
from katana450.errors import InputError


class ExportFormat(NamedTuple):
    """A row of the table.

    Attributes:
        help: description for the help of the command.
        posed: whether it is written at a pose.
        scene: whether it has the objects of a new server.
    """

    help: str
    posed: bool = False
    scene: bool = False


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
}
"""The formats by their names."""


def add_export_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of ``katana450 export`` to ``parser``."""
    parser.add_argument(
        "format",
        choices=tuple(FORMATS),
        help="; ".join(f"{name}: {row.help}" for name, row in FORMATS.items()),
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="directory for the files"
    )
    parser.add_argument(
        "--no-objects",
        dest="objects",
        action="store_false",
        help="vrml and x3d: leave out the cup and the basin of a new server",
    )
    parser.add_argument(
        "--scene", type=Path, metavar="FILE", help="mjcf: with the objects of a scene file"
    )
    add_pose_option(parser, "all at zero")
    add_arm_options(parser, tool=False)


def add_pose_option(parser: argparse._ActionsContainer, default: str) -> None:
    """Add ``--pose`` to ``parser``. ``default``: the pose without it, in words."""
    parser.add_argument(
        "--pose",
        type=joint_values,
        default=(),
        metavar="Q",
        help="comma-separated values of the driven joints in rad or m, gripper last, such as "
        f"--pose=0,-1.2,1.4,0.1,0,0.2 (default: {default})",
    )


def export_format(options: argparse.Namespace) -> int:
    """Execute ``katana450 export``; return the exit status."""
    row = FORMATS[options.format]
    if not row.scene and not options.objects:
        names = " or ".join(name for name, listed in FORMATS.items() if listed.scene)
        raise InputError(f"{options.format} has no objects. Use --no-objects with {names}.")
    if options.scene is not None and options.format != "mjcf":
        raise InputError(f"{options.format} has no scene of a file. Use --scene with mjcf.")
    if options.pose and not row.posed:
        names = ", ".join(name for name, listed in FORMATS.items() if listed.posed)
        raise InputError(f"{options.format} has no pose. Use --pose with {names}.")
    from katana450.extensions.export.export import export

    return export(options)


def joint_values(text: str) -> tuple[float, ...]:
    """Return the numbers [rad, m] of a comma-separated list. Raises ArgumentTypeError."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"expected comma-separated numbers, not {text!r}"
        ) from None
