"""Light from a surface to the camera: Lambert's cosine under three lamps and a bright sky."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from katana450.extensions.media.scene import Bools, Floats, light_of, unit
from katana450.server.view.room import FILL, KEY, RIM


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
    return Lamp(unit(np.array(position)), power * light_of(np.array(rgb, dtype=np.float32) / 255.0))


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
    x = np.clip(np.where(light > SHOULDER, soft, light), 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1.0 / 2.4) - 0.055).astype(np.float32)


SHOULDER = 0.75
"""Linear value above which highlights are compressed."""
