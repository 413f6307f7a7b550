"""``katana450 export html``: a run as a page that plays it without a server."""

from __future__ import annotations

import argparse
from pathlib import Path

from katana450.atomic import check_writable, write_files, writer_of
from katana450.errors import InputError
from katana450.extensions.export.playback import chosen
from katana450.extensions.export.recorded import recorded
from katana450.extensions.progress import progress

FPS = 25.0
"""States per second in the page; states between them are left out."""


def write_page(options: argparse.Namespace) -> int:
    """Write the file; print its name and size. Raises InputError."""
    path: Path = options.out
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{path} must end in .html.")
    check_writable(path)
    shown = chosen(options)
    title = f"{shown.robot.name}: {_shown(options.run, options.trajectory)}"
    count = int(shown.duration * FPS) + 1
    states = [shown.at(number / FPS) for number in range(count)]
    page = recorded(
        shown.robot, shown.session, progress(states, count, path.name), 1.0 / FPS, title
    ).encode()
    write_files({path: writer_of(page)})
    print(f"{path}: {len(page)} bytes")
    return 0


def _shown(run: str | None, trajectory: Path | None) -> str:
    """Return the name of the run or motion, for the title of the page."""
    if trajectory is not None:
        return trajectory.stem
    return "one pose" if run is None else Path(run).stem
