"""``katana450 export``: the arm, or any other robot, as files for other programs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from katana450.arm.robot.loader import load
from katana450.arm.robot.robot import Robot
from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.export.c_source import c_files
from katana450.extensions.export.glb import glb_files
from katana450.extensions.export.trajectory_file import RecordedMotion, load_motion
from katana450.extensions.export.urdf_package import (
    UNSTATED_LICENSE,
    UNSTATED_MAINTAINER,
    Maintainer,
    package_files,
)
from katana450.extensions.export.vrml import vrml_files
from katana450.resources import URDF_PATH

ANIMATED_FORMATS = ("vrml", "glb")
"""Formats that can contain a motion."""

OWN_LICENSE = "MIT"
"""Licence of the Katana450's description, the same as of this project."""

POSED_FORMATS = ("vrml", "c", "glb")
"""Formats that are written at a pose."""


def export(options: argparse.Namespace) -> int:
    """Write the files of one format; print their names and sizes. Raises InputError."""
    kind: str = options.format
    if options.trajectory is not None and kind not in ANIMATED_FORMATS:
        raise InputError(
            f"{kind} has no motion. Use --trajectory with {' or '.join(ANIMATED_FORMATS)}."
        )
    if options.run is not None:
        raise InputError(f"{kind} has no run. Use --run with html.")
    if options.pose and kind not in POSED_FORMATS:
        raise InputError(f"{kind} has no pose. Use --pose with {', '.join(POSED_FORMATS)}.")
    robot = load(options.urdf)
    robot.check_complete()
    robot.read_shapes()
    for note in robot.notes:
        print(f"katana450: {note}", file=sys.stderr)
    values = robot.values(options.pose)
    motion = None if options.trajectory is None else load_motion(options.trajectory, robot)
    files = _package(options) if kind == "urdf" else _files(kind, robot, values, motion)
    folder: Path = options.out
    try:
        for path in {(folder / name).parent for name in files}:
            path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be created: {error.strerror or error}.") from error
    write_files({folder / name: writer_of(content) for name, content in files.items()})
    for name, content in files.items():
        print(f"{folder / name}: {len(content)} bytes")
    return 0


def _files(
    kind: str,
    robot: Robot,
    values: Mapping[str, float],
    motion: RecordedMotion | None,
) -> Mapping[str, bytes]:
    match kind:
        case "vrml":
            return vrml_files(robot, values, motion)
        case "c":
            return c_files(robot, values)
    return glb_files(robot, values, motion)


def _package(options: argparse.Namespace) -> Mapping[str, bytes]:
    """Return the ROS package; print what its `package.xml` leaves for the user to state."""
    own = options.urdf.resolve() == URDF_PATH.resolve()
    license_name = options.license or (OWN_LICENSE if own else UNSTATED_LICENSE)
    maintainer = Maintainer(*options.maintainer) if options.maintainer else UNSTATED_MAINTAINER
    unstated = [
        word
        for word, missing in (
            ("--license", license_name == UNSTATED_LICENSE),
            ("--maintainer", maintainer == UNSTATED_MAINTAINER),
        )
        if missing
    ]
    if unstated:
        print(
            f"katana450: package.xml has a TODO for {' and '.join(unstated)}. State "
            f"{'it' if len(unstated) == 1 else 'them'} before you publish the package.",
            file=sys.stderr,
        )
    return package_files(options.urdf, license_name, maintainer)
