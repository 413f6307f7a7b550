"""``katana450 render``: a picture or a film of the arm, without a browser."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.arm.robot.props import load_props
from katana450.atomic import check_writable, write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.export.playback import Playback, chosen
from katana450.extensions.media.film import check_filmable, write_film
from katana450.extensions.media.picture import check_traceable, png
from katana450.extensions.media.stage import RenderStage, Shot, rendering_pool
from katana450.extensions.progress import progress


def render(options: argparse.Namespace) -> int:
    """Write the file; print its name and size. Raises InputError."""
    path: Path = options.out
    kind = path.suffix.lower()
    if kind not in (".png", ".mp4"):
        raise InputError(f"{path} must end in .png for a picture or in .mp4 for a film.")
    if kind == ".mp4" and options.run is None:
        raise InputError("A film needs a motion. Use --run.")
    check_traceable()
    check_writable(path)
    if kind == ".mp4":
        check_filmable(options.size, options.fps)
    shot = Shot(options.camera, options.size)
    shown = chosen(options)
    if kind == ".png":
        stage = RenderStage(shown.robot, shown.session, load_props())
        rendered = shot.taken(stage, shown.robot, shown.states[-1])
        write_files({path: writer_of(png(rendered))})
    else:
        _film(path, shown, shot, options)
    print(f"{path}: {path.stat().st_size} bytes")
    return 0


def _film(path: Path, shown: Playback, shot: Shot, options: argparse.Namespace) -> None:
    fps: float = options.fps
    count = int(shown.duration * fps) + 1
    states = (shown.at(number / fps) for number in range(count))
    with rendering_pool((shot,), options.urdf, shown.bare, count) as rendered:
        pictures = (image for (image,) in rendered(states))
        write_film(path, progress(pictures, count, path.name), shot.size, fps)
