"""Recordings as films."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt

from katana450.arm.control.state.state import State
from katana450.assembly.robot_session import DescribedRobot
from katana450.atomic import check_writable
from katana450.errors import InputError
from katana450.extensions.media.film import check_filmable, write_film
from katana450.extensions.media.picture import check_traceable
from katana450.extensions.media.stage import Shot, rendering_pool
from katana450.extensions.progress import progress
from katana450.extensions.recording.files.recording_file import RecordingFile
from katana450.extensions.recording.files.table import RecordedStates, frame_times
from katana450.resources import URDF_PATH

FILM_SUFFIX = ".mp4"


class PictureViews:
    """Renders the pictures of views of one robot."""

    def __init__(
        self, views: Sequence[str], size: tuple[int, int], urdf: Path | None, bare: bool
    ) -> None:
        """Take pictures of ``size`` [px]. Raises MissingExtraError without the renderer.

        Args:
            views: names of the cameras.
            size: width and height [px].
            urdf: file of the robot; None for the one of this program.
            bare: whether it has no gripper.
        """
        check_traceable()
        self._shots = [Shot(view, size) for view in views]
        self._urdf, self._bare = URDF_PATH if urdf is None else urdf, bare

    @contextmanager
    def pictures(
        self, states: Iterator[State], count: int
    ) -> Iterator[Iterator[tuple[npt.NDArray[np.uint8], ...]]]:
        """Yield the pictures of all views for each of the ``count`` states."""
        with rendering_pool(self._shots, self._urdf, self._bare, count) as rendered:
            yield rendered(states)


def write_film_of(
    file: RecordingFile,
    out: Path,
    part: tuple[float, float],
    fps: int,
    robot: DescribedRobot,
    views: PictureViews,
    size: tuple[int, int],
) -> int:
    """Write a film of the ``part`` [s] of ``file``; return the number of pictures.

    Raises InputError.
    """
    if out.suffix.lower() != FILM_SUFFIX:
        raise InputError(f"{out} must end in {FILM_SUFFIX}.")
    check_writable(out)
    check_filmable(size, fps)
    times = frame_times(*part, fps)
    reader = RecordedStates(file, robot.session)
    with views.pictures(reader.at(times), len(times)) as images:
        pictures = (first for (first,) in images)
        count = write_film(out, progress(pictures, len(times), out.name), size, fps)
    report_unknown(reader)
    return count


def report_unknown(reader: RecordedStates) -> None:
    """Print how many ticks of ``reader`` could not be simulated, if any."""
    if reader.unknown:
        print(
            f"katana450: {reader.unknown} ticks cannot be simulated. Joints are as recorded; "
            "objects and water hold still there.",
            file=sys.stderr,
        )
