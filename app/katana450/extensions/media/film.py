"""Films: pictures as H.264 in an MP4 file."""

from __future__ import annotations

import secrets
import shutil
import subprocess
from collections.abc import Iterable
from contextlib import suppress
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extras import library

CODEC = "libx264"
"""Encoder of ffmpeg for H.264."""


@cache
def ffmpeg() -> str:
    """Return the path of the system's ffmpeg, or of the one in the extra ``films``.

    Raises MissingExtraError without both.
    """
    path = shutil.which("ffmpeg")
    if path is not None:
        command = [path, "-hide_banner", "-encoders"]
        # Some systems leave the codec out.
        if CODEC in subprocess.run(command, capture_output=True, text=True, check=False).stdout:
            return path
    return str(library("imageio_ffmpeg", "films", "Films").get_ffmpeg_exe())


class VideoEncoder:
    """A video that is being written."""

    def __init__(self, path: Path, size: tuple[int, int], fps: float, *options: str) -> None:
        """Begin the video at ``path``, which is replaced. Raises MissingExtraError.

        Args:
            path: the file.
            size: width and height [px], both even.
            fps: pictures per second.
            options: further options of ffmpeg.
        """
        command = [
            *(ffmpeg(), "-y", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
            *("-s", f"{size[0]}x{size[1]}", "-r", str(Fraction(fps).limit_denominator())),
            *("-i", "-", "-an", "-c:v", CODEC, "-pix_fmt", "yuv420p", *options),
            *("-movflags", "+faststart", str(path)),
        ]
        # In a group of its own, which Ctrl-C at a terminal does not interrupt.
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, process_group=0)

    def add(self, picture: npt.NDArray[np.uint8]) -> None:
        """Add the next ``picture`` (height, width, 3) sRGB. Raises OSError if ffmpeg has ended."""
        assert self._process.stdin is not None
        self._process.stdin.write(np.ascontiguousarray(picture).data)

    def finish(self) -> None:
        """Complete the file. Raises OSError if ffmpeg fails, which reports the cause itself."""
        self._process.communicate()
        if self._process.returncode:
            raise OSError("ffmpeg has failed")

    def abandon(self) -> None:
        """End ffmpeg, whatever it has written."""
        self._process.kill()
        with suppress(OSError):
            self._process.communicate()


CRF = 10
"""Quality of the encoding, from 0 (exact) to 51."""

SLOWEST, FASTEST = 1.0, 120.0
"""Range of pictures per second."""


def check_filmable(size: tuple[int, int], fps: float) -> None:
    """Raise InputError unless a film can have ``size`` [px] and ``fps`` pictures per second.

    Raises MissingExtraError without ffmpeg.
    """
    if any(side % 2 for side in size):
        raise InputError(f"The width and height of a film must be even, not {size[0]}x{size[1]}.")
    if not SLOWEST <= fps <= FASTEST:
        raise InputError(
            f"A film must have {SLOWEST:g} to {FASTEST:g} pictures per second, not {fps:g}."
        )
    ffmpeg()


def write_film(
    path: Path,
    pictures: Iterable[npt.NDArray[np.uint8]],
    size: tuple[int, int],
    fps: float,
) -> int:
    """Write ``pictures``, each (height, width, 3) sRGB; return their number.

    The file is written completely or not at all. Raises InputError if it cannot be written.
    """
    check_filmable(size, fps)
    # ffmpeg determines the format from the suffix.
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(4)}.mp4")
    encoder = VideoEncoder(temporary, size, fps, "-crf", str(CRF))
    count = 0
    try:
        for picture in pictures:
            encoder.add(picture)
            count += 1
        if not count:
            raise InputError("A film must have at least one picture.")
        encoder.finish()
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}.") from error
    finally:
        encoder.abandon()
        temporary.unlink(missing_ok=True)
    return count
