"""Pictures of the cameras in a recording, at the times of the frames of a dataset."""

from __future__ import annotations

import io
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import repeat
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from katana450.errors import InputError
from katana450.extensions.recording.files.pictures import jpeg_of
from katana450.extensions.recording.files.recording_file import Message, RecordingFile
from katana450.extensions.recording.messages import CAMERAS
from katana450.maths.geometry.arrays import FloatArray

MAX_GAP = 0.5
"""[s] Maximum time between a frame and its picture."""

MAX_PIXELS = 20_000_000
"""Maximum number of pixels of a picture."""

Size = tuple[int, int]
"""Width and height [px], both even."""

Pixels = npt.NDArray[np.uint8]
"""A picture (height, width, 3) sRGB."""


def cameras_of(paths: Sequence[Path], names: Collection[str] | None) -> dict[str, Size]:
    """Return the cameras of the recordings ``paths``, with the size of their pictures.

    Args:
        paths: the recordings.
        names: the cameras to take, which all of them must have; those that all have if it is None.

    Raises:
        InputError: a recording lacks one of ``names``, or a picture cannot be read.
    """
    sizes: dict[str, Size] = {}
    common: list[str] | None = None if names is None else list(dict.fromkeys(names))
    for path in paths:
        with RecordingFile.open(path) as file:
            counts = file.counts()
            recorded = [name for name in file.cameras if counts[CAMERAS + name]]
            missing = sorted(set(names or ()) - set(recorded))
            if missing:
                raise InputError(f"{path} has no pictures of the camera {missing[0]}.")
            common = [name for name in recorded if common is None or name in common]
            for name in set(common) - set(sizes):
                height, width, _ = _pixels(next(file.messages(CAMERAS + name))).shape
                sizes[name] = (width // 2 * 2, height // 2 * 2)
    return {name: sizes[name] for name in common or ()}


def recorded_pictures(
    path: Path, cameras: Mapping[str, Size], times: FloatArray
) -> Iterator[tuple[Pixels, ...]]:
    """Yield the newest picture of each of ``cameras`` at each of ``times`` (N,) [s].

    Before the first picture of a camera, that one counts. Each is (height, width, 3) sRGB in the
    size of its camera. Raises InputError where a camera has none for longer than `MAX_GAP`.
    """
    if not cameras:
        yield from repeat((), len(times))
        return
    with RecordingFile.open(path) as file:
        newest = [_newest_at(file, name, size, times) for name, size in cameras.items()]
        yield from zip(*newest, strict=True)


def _newest_at(file: RecordingFile, camera: str, size: Size, times: FloatArray) -> Iterator[Pixels]:
    """Yield the newest picture of ``camera`` at each of ``times`` (N,) [s]. Raises InputError."""
    messages = file.messages(CAMERAS + camera, start=float(times[0]) - MAX_GAP)
    shown, following = next(messages, None), next(messages, None)
    pixels: Pixels | None = None
    for t in times.tolist():
        while following is not None and following.t <= t:
            shown, following, pixels = following, next(messages, None), None
        if shown is None or abs(t - shown.t) > MAX_GAP:
            raise InputError(
                f"The camera {camera} has no picture within {MAX_GAP:g} s of "
                f"{t - file.start:.2f} s in {file.path}. Trim that part away, or name the other "
                "cameras by --cameras."
            )
        if pixels is None:
            pixels = _pixels(shown, size)
        yield pixels


def _pixels(message: Message, size: Size | None = None) -> Pixels:
    """Return the picture (height, width, 3) sRGB in a message, in its own or another size.

    Raises InputError if it cannot be read.
    """
    try:
        with Image.open(io.BytesIO(jpeg_of(message)), formats=("JPEG",)) as picture:
            if math.prod(picture.size) > MAX_PIXELS:
                raise ValueError(f"it has {picture.size[0]}x{picture.size[1]} pixels")
            colours = picture.convert("RGB")
    except (OSError, ValueError, SyntaxError) as error:
        raise InputError(
            f"A picture of {message.topic} at {message.t:.3f} s cannot be read: {error}."
        ) from error
    return np.asarray(colours if size in (None, colours.size) else colours.resize(size))
