"""Light to the camera: from surfaces, by Lambert's cosine, from the floor and the background.

The room is that of the page. Three lamps and a bright sky light it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from katana450.extensions.media.camera import Camera
from katana450.extensions.media.hits import Hits
from katana450.extensions.media.scene import Bools, Floats, Ints, unit
from katana450.server.view.room import FILL, KEY, RIM
from katana450.server.viser_bridge.themes import Theme
from katana450.srgb import to_light, to_srgb

CELLS = ((0.05, 0.6), (0.25, 1.0))
"""Distance [m] and width [px] of the lines on the floor: fine lines, and main lines."""

FADE_DISTANCE = 5.0
"""[m] Distance at which the floor has faded to the background."""


def background(theme: Theme, camera: Camera, y: Floats) -> Floats:
    """Return the light (n, 3) of the background at rows ``y`` (n,) [px] of the picture."""
    fraction = np.clip(y / camera.size[1], 0.0, 1.0)[:, None]
    top, bottom = (np.array(c, dtype=np.float32) / 255.0 for c in (theme.sky, theme.floor))
    return to_light(top + fraction * (bottom - top)).astype(np.float32)


def floor_light(theme: Theme, camera: Camera, hits: Hits, lit: Bools, behind: Floats) -> Floats:
    """Return the light (n, 3) of points on the floor, faded to the background ``behind`` (n, 3)."""
    colour = np.tile(np.array(theme.floor, dtype=np.float32) / 255.0, (len(hits.points), 1))
    for (apart, wide), line in zip(CELLS, (theme.cell, theme.section), strict=True):
        fraction = _lines(camera, hits, apart, wide)[:, None]
        colour += fraction * (np.array(line, dtype=np.float32) / 255.0 - colour)
    colour[~lit] *= 1.0 - theme.shadow
    shown = to_light(colour)
    east, north = (hits.points[:, :2] - np.array(camera.position[:2], dtype=np.float32)).T
    left = np.clip(1.0 - np.hypot(east, north) / FADE_DISTANCE, 0.0, 1.0)[:, None]
    return np.asarray(behind + left * (shown - behind), dtype=np.float32)


def dithered(colours: Floats, rows: Ints, columns: Ints) -> Floats:
    """Return colours (n, 3) of the background with the pattern of their pixels added.

    Its low contrast would show steps.
    """
    finer = (TILE[rows % 4, columns % 4] - 7.5) / (16.0 * 255.0)
    return np.clip(colours + finer[:, None], 0.0, 1.0).astype(np.float32)


TILE = np.array(((0, 8, 2, 10), (12, 4, 14, 6), (3, 11, 1, 9), (15, 7, 13, 5)))
"""Order of the sixteen pixels of a tile in which they become brighter; neighbours are far apart."""


def _lines(camera: Camera, hits: Hits, apart: float, wide: float) -> Floats:
    """Return the fraction (n,) of each pixel covered by lines ``apart`` [m] and ``wide`` [px]."""
    right, up, _ = camera.frame
    step = camera.pixel * hits.distance
    down = hits.directions[:, 2]
    covered = np.zeros(len(down), dtype=np.float32)
    for axis in (0, 1):
        # Distance on the floor along the axis between neighbouring pixels.
        slope = hits.directions[:, axis] / down
        moved = step * np.hypot(right[axis] - slope * right[2], up[axis] - slope * up[2])
        at = hits.points[:, axis] / apart
        off = np.abs(at - np.round(at)) * apart / moved
        line = np.clip(0.5 * wide + 0.5 - off, 0.0, min(wide, 1.0))
        # Lines closer than pixels merge to a uniform tone.
        tone = np.minimum(wide * moved / apart, 1.0)
        blend = np.clip(2.0 * moved / apart - 0.5, 0.0, 1.0)
        covered = np.maximum(covered, line + blend * (tone - line))
    return covered


class Lamp(NamedTuple):
    """A distant light.

    Attributes:
        towards: (3,) unit direction to it.
        colour: (3,) light from a white surface perpendicular to it.
    """

    towards: Floats
    colour: Floats


def lamp(position: tuple[float, float, float], rgb: tuple[int, int, int], power: float) -> Lamp:
    """Return a lamp at ``position``, directed to the base. ``rgb`` is its colour, 0 to 255."""
    return Lamp(
        unit(np.array(position)), power * to_light(np.array(rgb) / 255.0).astype(np.float32)
    )


LAMPS: tuple[Lamp, ...] = (
    lamp(KEY, (255, 250, 242), 1.0),
    lamp(RIM, (226, 238, 255), 0.42),
    lamp(FILL, (255, 255, 255), 0.16),
)
"""The lamps; the first casts shadows."""

ZENITH, GROUND = 0.8, 0.3
"""Light of the sky from above and from below, relative to a white surface."""


SHEEN = 0.03
"""[1] Fraction of the light that every surface reflects, so that black parts show their shape."""


def shaded(colour: Floats, normals: Floats, lit: Bools) -> Floats:
    """Return the light (n, 3) of surfaces. ``lit`` (n,): whether lamp 0 reaches them."""
    up = 0.5 + 0.5 * normals[:, 2:]
    total = np.tile(GROUND + (ZENITH - GROUND) * up, (1, 3))
    for number, each in enumerate(LAMPS):
        cosine = np.maximum(normals @ each.towards, 0.0)
        total += (cosine * lit if number == 0 else cosine)[:, None] * each.colour
    return np.asarray((SHEEN + (1.0 - SHEEN) * colour) * total, dtype=np.float32)


def developed(light: Floats) -> Floats:
    """Return light as sRGB 0..1: unchanged up to the shoulder, then softly up to white."""
    over = np.maximum(light - SHOULDER, 0.0) / (1.0 - SHOULDER)
    soft = SHOULDER + (1.0 - SHOULDER) * (1.0 - np.exp(-over))
    return to_srgb(np.where(light > SHOULDER, soft, light)).astype(np.float32)


SHOULDER = 0.75
"""Linear value above which highlights are compressed."""
