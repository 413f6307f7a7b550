"""Films: pictures as H.264 in an MP4 file, written by the ffmpeg of imageio-ffmpeg."""

from __future__ import annotations

import importlib
import secrets
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from katana450.errors import InputError

QUALITY = 8
"""Quality of the encoding, from 0 to 10."""

SLOWEST, FASTEST = 1.0, 120.0
"""Range of pictures per second."""


def check_filmable(size: tuple[int, int], fps: float) -> None:
    """Raise InputError unless a film can have ``size`` [px] and ``fps`` pictures per second."""
    if any(side % 2 for side in size):
        raise InputError(f"The width and height of a film must be even, not {size[0]}x{size[1]}.")
    if not SLOWEST <= fps <= FASTEST:
        raise InputError(
            f"A film must have {SLOWEST:g} to {FASTEST:g} pictures per second, not {fps:g}."
        )


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
    ffmpeg: Any = importlib.import_module("imageio_ffmpeg")
    # ffmpeg determines the format from the suffix.
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(4)}.mp4")
    writer = ffmpeg.write_frames(
        str(temporary),
        size,
        fps=fps,
        codec="libx264",
        quality=QUALITY,
        macro_block_size=2,
        ffmpeg_log_level="error",
        output_params=["-movflags", "+faststart"],
    )
    count = 0
    try:
        writer.send(None)
        for picture in pictures:
            writer.send(np.ascontiguousarray(picture))
            count += 1
        writer.close()
        if not count:
            raise InputError("A film must have at least one picture.")
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}.") from error
    finally:
        with suppress(OSError):
            writer.close()
        temporary.unlink(missing_ok=True)
    return count
