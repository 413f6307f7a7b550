"""The room round the arm: floor, sky and light, in a light and a dark theme."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

import numpy as np
import viser
from viser import _messages as wire

from katana450.arm.control.state.solid import Colour

FLOOR_AT = -0.0255
"""Height [m] of the floor, slightly below the table so that the two do not flicker."""

KEY, RIM, FILL = (0.7, -0.9, 1.9), (-1.0, 1.4, 0.9), (1.2, 1.0, 0.6)
"""Positions [m] of the lights, which shine towards the base."""


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


def set_up_room(server: viser.ViserServer, floor: float = FLOOR_AT) -> None:
    """Light the scene and set the light theme, which the page replaces in a dark window.

    ``floor``: its height [m].
    """
    scene = server.scene
    scene.configure_default_lights(enabled=False)
    # The key light shines from the front, left and above; the rim light sets arm and sky apart.
    scene.add_light_directional(
        "/light/key", intensity=1.7, cast_shadow=True, color=(255, 250, 242), position=KEY
    )
    scene.add_light_directional("/light/rim", intensity=0.9, color=(226, 238, 255), position=RIM)
    scene.add_light_directional("/light/fill", intensity=0.35, position=FILL)
    scene.configure_environment_map("studio", environment_intensity=0.45)
    _paint(scene, LIGHT, floor)
    set_sky(server, LIGHT)


def _paint(scene: viser.SceneApi, theme: Theme, floor: float) -> None:
    scene.add_grid(
        "/floor",
        infinite_grid=True,
        cell_size=0.05,
        cell_thickness=0.6,
        cell_color=theme.cell,
        section_size=0.25,
        section_thickness=1.0,
        section_color=theme.section,
        plane_color=theme.floor,
        plane_opacity=1.0,
        fade_distance=5.0,
        shadow_opacity=theme.shadow,
        position=(0.0, 0.0, floor),
    )
