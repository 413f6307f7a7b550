"""Colours of the room round the arm, in a light and a dark theme."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

import numpy as np
import viser
from viser import _messages as wire

from katana450.arm.control.solid import Colour


@dataclass(frozen=True)
class Theme:
    """The look of the room.

    Attributes:
        floor: colour of the floor.
        cell: colour of the fine grid lines.
        section: colour of the coarse grid lines.
        sky: colour of the sky at the top.
        shadow: opacity of shadows on the floor (0 to 1).
        dark: whether the panel is dark.
    """

    floor: Colour
    cell: Colour
    section: Colour
    sky: Colour
    shadow: float
    dark: bool


LIGHT = Theme((226, 231, 236), (207, 213, 220), (178, 187, 197), (247, 249, 251), 0.35, dark=False)
DARK = Theme((38, 42, 48), (50, 55, 62), (70, 77, 87), (22, 24, 28), 0.6, dark=True)

THEMES = {"Light": LIGHT, "Dark": DARK}


def sky(theme: Theme) -> bytes:
    """Return the sky as a PNG file, 2 by 128 pixels, with a gradient down to the floor's colour."""
    colours = np.linspace(theme.sky, theme.floor, 128).round().astype(np.uint8)
    # Each line begins with its filter, which is none.
    lines = b"".join(b"\0" + colour.tobytes() * 2 for colour in colours)
    header = struct.pack(">IIBBBBB", 2, len(colours), 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(lines)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


def set_sky(server: viser.ViserServer, theme: Theme) -> None:
    """Show the sky. viser's own method imports every file format of its library of images."""
    message = wire.BackgroundImageMessage(format="png", rgb_data=sky(theme), depth_data=None)
    server._websock_server.queue_message(message)
