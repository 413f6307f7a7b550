"""``katana450 export``: the arm, or any other robot, as files for other programs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

from katana450.arm.robot.robot import Robot
from katana450.assembly.robot_files import read_robot
from katana450.assembly.robot_session import find_arm
from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.export.c_source import c_files
from katana450.extensions.export.glb import glb_files
from katana450.extensions.export.mjcf import mjcf_files
from katana450.extensions.export.urdf_package import package_files
from katana450.extensions.export.vrml.vrml_files import (
    initial_objects,
    vrml_files,
    world_of,
    x3d_files,
)


def export(options: argparse.Namespace) -> int:
    """Write the files of one format; print their names and sizes. Raises InputError."""
    robot = read_robot(options.urdf)
    robot.check_complete()
    robot.read_shapes()
    for note in robot.notes:
        print(f"katana450: {note}", file=sys.stderr)
    files = _files(options, robot)
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


def _files(options: argparse.Namespace, robot: Robot) -> Mapping[str, bytes]:
    """Return names and contents of the files."""
    values = robot.values(options.pose)
    match options.format:
        case "c":
            return c_files(robot, values)
        case "glb":
            return glb_files(robot, values)
        case "urdf":
            return package_files(options.urdf)
        case "mjcf":
            return mjcf_files(read_robot(options.urdf, None, find_arm), options.scene)
    objects = initial_objects(robot) if options.objects else ()
    world = world_of(robot, values, objects)
    return (vrml_files if options.format == "vrml" else x3d_files)(robot, world)
