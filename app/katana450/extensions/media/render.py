"""``katana450 render``: a picture of the arm, without a browser."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.arm.robot.props import load_props
from katana450.atomic import check_writable, write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.media.picture import check_traceable, png
from katana450.extensions.media.posed import posed
from katana450.extensions.media.stage import RenderStage, Shot


def render(options: argparse.Namespace) -> int:
    """Write the file; print its name and size. Raises InputError."""
    path: Path = options.out
    if path.suffix.lower() != ".png":
        raise InputError(f"{path} must end in .png. `record export --format mp4` makes films.")
    check_traceable()
    check_writable(path)
    robot, session, state = posed(options.pose, options.urdf)
    stage = RenderStage(robot, session, load_props())
    picture = Shot(options.camera, options.size).taken(stage, robot, state)
    write_files({path: writer_of(png(picture))})
    print(f"{path}: {path.stat().st_size} bytes")
    return 0
