"""Videos of a dataset: the pictures of one view, with episodes one after another in files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.extensions.media.film import VideoEncoder
from katana450.extensions.recording.datasets.lerobot_writer import (
    VIDEO_MB,
    VIDEO_PATH,
    PixelCounts,
    place,
)

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
        self._encoder: VideoEncoder | None = None
        self._path = folder
        self._file = -1
        self._written = self._begin = 0
        self.counts = PixelCounts()
        """Pixels of all episodes that have ended."""
        self._episode = PixelCounts()

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Add the next ``picture`` (height, width, 3) of the present episode."""
        if self._encoder is None:
            self._encoder = self._open()
        self._encoder.add(picture)
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
        """Complete the present file. Raises OSError if that fails, as on a full disk."""
        if self._encoder is not None:
            self._encoder.finish()
            self._encoder = None

    def abandon(self) -> None:
        """End the encoder, whatever it has written."""
        if self._encoder is not None:
            self._encoder.abandon()

    def _open(self) -> VideoEncoder:
        self._file += 1
        chunk, file = place(self._file)
        name = VIDEO_PATH.format(video_key=self._feature, chunk_index=chunk, file_index=file)
        self._path = self._folder / name
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._written = self._begin = 0
        # Pictures that refer to later ones would not begin at time 0.
        options = ("-crf", str(CRF), "-g", str(KEY_PICTURES), "-bf", "0")
        return VideoEncoder(self._path, self._size, self._fps, *options)
