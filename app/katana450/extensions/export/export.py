"""``katana450 export``: the arm, or any other robot, as files for other programs."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from katana450.assembly.robot_files import read_robot
from katana450.atomic import write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.export.formats import FORMATS, ExportJob, named

LARGE_BYTES = 20_000_000
"""Size [bytes] of all files together above which the command says why."""


def export(
    options: argparse.Namespace, files_of: Callable[[ExportJob], Mapping[str, bytes]]
) -> int:
    """Write the files of one format; print their names and sizes. Raises InputError.

    ``files_of`` returns names and contents of the files.
    """
    _check(options)
    robot = read_robot(options.urdf)
    robot.check_complete()
    robot.read_shapes()
    for note in robot.notes:
        print(f"katana450: {note}", file=sys.stderr)
    values = robot.values(options.pose)
    files = files_of(ExportJob(options, robot, values))
    folder: Path = options.out
    try:
        for path in {(folder / name).parent for name in files}:
            path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be created: {error.strerror or error}.") from error
    write_files({folder / name: writer_of(content) for name, content in files.items()})
    for name, content in files.items():
        print(f"{folder / name}: {len(content)} bytes")
    total = sum(map(len, files.values()))
    if total > LARGE_BYTES:
        triangles = sum(len(shape.faces) for link in robot.links for shape in link.shapes)
        print(
            f"katana450: These are {total / 1e6:.0f} MB, because the meshes have {triangles:,} "
            "triangles. Reduce the mesh files to get smaller ones; glb is the smallest format.",
            file=sys.stderr,
        )
    return 0


def _check(options: argparse.Namespace) -> None:
    """Raise InputError for an option that the format cannot follow."""
    kind: str = options.format
    row = FORMATS[kind]
    if options.trajectory is not None or options.run is not None:
        raise InputError(f"{kind} has no motion. Use --trajectory or --run with html.")
    if options.pose and not row.posed:
        names = ", ".join(named(lambda listed: listed.posed))
        raise InputError(f"{kind} has no pose. Use --pose with {names}.")
