"""Portable Network Graphics, second edition (ISO/IEC 15948), as much as a picture of ours takes."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import numpy.typing as npt

UP = 2
"""Filter type: each byte less that above it."""


def png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """The file of (height, width, 3) sRGB; the same pixels give the same bytes."""
    height, width, _ = pixels.shape
    rows = pixels.reshape(height, -1)
    lines = np.empty((height, rows.shape[1] + 1), dtype=np.uint8)
    lines[:, 0] = UP
    lines[0, 1:] = rows[0]
    lines[1:, 1:] = rows[1:] - rows[:-1]
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"".join(
        (
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", header),
            _chunk(b"sRGB", b"\0"),
            _chunk(b"IDAT", zlib.compress(lines.tobytes(), 9)),
            _chunk(b"IEND", b""),
        )
    )


def _chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
