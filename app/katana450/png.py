"""PNG files of pictures, by Pillow."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt
from PIL import Image, PngImagePlugin


def png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """Return the file of (height, width, 3) sRGB; the same pixels give the same bytes."""
    colours = PngImagePlugin.PngInfo()
    colours.add(b"sRGB", b"\0")
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG", compress_level=9, pnginfo=colours)
    return out.getvalue()
