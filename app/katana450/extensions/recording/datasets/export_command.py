"""``katana450 record export``: recordings as files for other programs."""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from katana450.errors import InputError
from katana450.extensions.recording.datasets.lerobot_export import (
    DEFAULT_OUTCOMES,
    Exported,
    LerobotOptions,
    export_lerobot,
    files_of,
)
from katana450.extensions.recording.datasets.ros_bag import write_bag
from katana450.extensions.recording.datasets.sampling import frame_times
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.simulation import session_for
from katana450.extensions.recording.files.table import write_csv
from katana450.extensions.recording.files.trimming import trim
from katana450.extensions.recording.options import (
    DEFAULT_FPS,
    DEFAULT_SIZES,
    OPTION_NAMES,
    USED,
)


def check_options(options: argparse.Namespace) -> None:
    """Raise InputError for an option that the format does not have."""
    for name, formats in USED.items():
        if getattr(options, name) is not None and options.format not in formats:
            option = OPTION_NAMES.get(name, f"--{name}")
            raise InputError(
                f"{options.format} has no {option}. Use it with {' or '.join(formats)}."
            )


def export(options: argparse.Namespace) -> object:
    """Write the file or folder; return what it has, in words. Raises KatanaError."""
    if options.format == "lerobot":
        return _lerobot(options)
    with _joined(options.files) as file:
        start, end = file.start + options.start, min(file.start + options.end, file.end)
        if start > end:
            raise InputError(
                f"There is nothing from {options.start:g} to {options.end:g} s; the recording has "
                f"{file.end - file.start:.1f} s."
            )
        return _exported(options, file, start, end)


def _exported(options: argparse.Namespace, file: RecordingFile, start: float, end: float) -> str:
    """Write the part of ``file`` from ``start`` to ``end`` [s]; return what was written."""
    out: Path = options.out
    match options.format:
        case "csv":
            count, what = write_csv(file, out, start, end), "row"
        case "rosbag2":
            count, what = write_bag(file, out, start, end), "message"
        case "html":
            from katana450.extensions.export.page import FPS
            from katana450.extensions.recording.datasets.player_files import write_page_of

            times, robot = frame_times(start, end, int(FPS)), session_for(file, options.urdf)
            count, what = write_page_of(file, out, times, robot), "state"
        case _:
            count, what = _film(options, file, start, end), "picture"
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _film(options: argparse.Namespace, file: RecordingFile, start: float, end: float) -> int:
    """Write a film of the part of ``file``; return the number of its pictures."""
    from katana450.extensions.recording.datasets.player_files import (
        PictureViews,
        write_film_of,
    )

    views = options.views or ["free"]
    if len(views) > 1:
        raise InputError(f"A film has one view, not {len(views)}. Export one film for each.")
    size = options.size or DEFAULT_SIZES["mp4"]
    fps = DEFAULT_FPS["mp4"] if options.fps is None else options.fps
    pictures = PictureViews(views, size, options.urdf, file.settings.bare)
    robot = session_for(file, options.urdf)
    return write_film_of(file, options.out, (start, end), fps, robot, pictures, size)


def _lerobot(options: argparse.Namespace) -> Exported:
    views = tuple(dict.fromkeys(options.views or ()))
    size = options.size or DEFAULT_SIZES["lerobot"]
    request = LerobotOptions(
        fps=DEFAULT_FPS["lerobot"] if options.fps is None else options.fps,
        task=options.task or "",
        outcomes=options.outcomes or DEFAULT_OUTCOMES,
        part=(options.start, options.end),
        views=views,
        size=size,
    )
    if len(options.files) > 1 and request.part != (0.0, math.inf):
        raise InputError("--from and --to cut one recording; trim several one by one before.")
    if not views:
        return export_lerobot(options.files, options.out, request)
    from katana450.extensions.media.film import check_filmable
    from katana450.extensions.recording.datasets.player_files import PictureViews

    check_filmable(size, request.fps)
    with RecordingFile.open(files_of(options.files)[0]) as first:
        robot = session_for(first, options.urdf)
        pictures = PictureViews(views, size, options.urdf, first.settings.bare)
    return export_lerobot(options.files, options.out, request, robot.session, pictures.pictures)


@contextmanager
def _joined(paths: Sequence[Path]) -> Iterator[RecordingFile]:
    """Yield the recording of ``paths``; several of one run are joined."""
    if len(paths) == 1:
        with RecordingFile.open(paths[0]) as file:
            yield file
        return
    with tempfile.TemporaryDirectory(prefix="katana450-") as folder:
        path = Path(folder) / paths[0].name
        trim(paths, path, -math.inf, math.inf)
        with RecordingFile.open(path) as file:
            yield file
