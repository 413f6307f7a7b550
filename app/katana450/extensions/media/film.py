"""Films: pictures as H.264 in an MP4 file."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError
from katana450.extensions.media.ffmpeg import VideoEncoder, ffmpeg

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
