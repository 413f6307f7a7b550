"""Videos of a dataset: the pictures of one view, with episodes one after another in files."""

from __future__ import annotations

from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.recording.datasets.lerobot_form import (
    PIXEL_FORMAT,
    VIDEO_MB,
    VIDEO_PATH,
    place,
)
from katana450.extensions.recording.datasets.statistics import PixelCounts

CRF = 18
"""Quality of the encoding, from 0 (exact) to 51."""

KEY_PICTURES = 2
"""Every second picture can be decoded alone, so that training may read them in any order."""

MEGABYTE = 2**20


class EpisodeVideo:
    """Writes the pictures of one view."""

    def __init__(self, folder: Path, feature: str, size: tuple[int, int], fps: int) -> None:
        """Write into the dataset in ``folder``.

        Args:
            folder: folder of the dataset.
            feature: name of the feature.
            size: width and height [px], both even.
            fps: pictures per second.
        """
        self._folder, self._feature, self._size, self._fps = folder, feature, size, fps
        self._writer: Any = None
        self._path = folder
        self._file = -1
        self._written = self._begin = 0
        self.counts = PixelCounts()
        """Pixels of all episodes that have ended."""
        self._episode = PixelCounts()

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Add the next ``picture`` (height, width, 3) of the present episode."""
        if self._writer is None:
            self._open()
        self._writer.send(np.ascontiguousarray(picture))
        self._episode.add(picture)
        self._written += 1

    def end_episode(self) -> tuple[dict[str, Any], dict[str, list[Any]]]:
        """End an episode; return where it is, as columns of its row, and its statistics."""
        chunk, file = place(self._file)
        named = f"videos/{self._feature}"
        row = {
            f"{named}/chunk_index": chunk,
            f"{named}/file_index": file,
            f"{named}/from_timestamp": self._begin / self._fps,
            f"{named}/to_timestamp": self._written / self._fps,
        }
        statistics = self._episode.statistics
        self.counts.merge(self._episode)
        self._episode, self._begin = PixelCounts(), self._written
        if self._path.is_file() and self._path.stat().st_size > VIDEO_MB * MEGABYTE:
            self.finish()
        return row, statistics

    def finish(self) -> None:
        """Complete the present file. Raises InputError if it lacks pictures, as on a full disk."""
        if self._writer is None:
            return
        self._writer.close()
        self._writer = None
        ffmpeg: Any = import_module("imageio_ffmpeg")
        found, _ = ffmpeg.count_frames_and_secs(str(self._path))
        if found != self._written:
            raise InputError(
                f"The video of {self._feature} has {found} of {self._written} pictures. Is the "
                "disk full?"
            )

    def abandon(self) -> None:
        """End the encoder, whatever it has written."""
        if self._writer is not None:
            with suppress(OSError):
                self._writer.close()

    def _open(self) -> None:
        self._file += 1
        chunk, file = place(self._file)
        name = VIDEO_PATH.format(video_key=self._feature, chunk_index=chunk, file_index=file)
        self._path = self._folder / name
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._written = self._begin = 0
        ffmpeg: Any = import_module("imageio_ffmpeg")
        self._writer = ffmpeg.write_frames(
            str(self._path),
            self._size,
            fps=self._fps,
            codec="libx264",
            pix_fmt_out=PIXEL_FORMAT,
            quality=None,
            macro_block_size=2,
            ffmpeg_log_level="error",
            # Pictures that refer to later ones would not begin at time 0.
            output_params=[
                *("-crf", str(CRF), "-g", str(KEY_PICTURES), "-bf", "0"),
                *("-movflags", "+faststart"),
            ],
        )
        self._writer.send(None)
