"""A picture: every pixel seen once, lit, and where surfaces end four times more."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from katana450.extensions.media import room
from katana450.extensions.media.camera import Camera
from katana450.extensions.media.light import TILE, Light, reaching
from katana450.extensions.media.scene import Bools, Floats, Ints, Item, Scene
from katana450.extensions.media.shading import Stuff, developed, shaded
from katana450.extensions.media.sight import FLOOR, NOWHERE, Sight, look, through
from katana450.extensions.media.tracer import Tracer
from katana450.server.viser_bridge.themes import Theme

STILL, MOVING = 4, 1
"""Rays of each kind for a pixel: of a picture, of one in a film."""

CORNERS = ((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875))
"""Of a pixel, where it is looked at where surfaces end."""

BENT = 0.94
"""Cosine between normals of neighbours that counts as an edge."""

STEP = 4e-3
"""[m] Off a neighbour's plane that counts as one."""


class Translucent(NamedTuple):
    """Something to be seen through. opacity: the share of what is behind it that it hides."""

    item: Item
    opacity: float


@dataclass(frozen=True, eq=False)
class Picture:
    """pixels: (height, width, 3) sRGB of 255. item: (height, width) the item that the middle of
    each pixel shows, FLOOR or NOWHERE. names: of the items, those that are seen through last."""

    pixels: npt.NDArray[np.uint8]
    item: Ints
    names: tuple[str, ...]

    @property
    def png(self) -> bytes:
        """The picture as a PNG file; the same pixels give the same bytes."""
        file = io.BytesIO()
        Image.fromarray(self.pixels).save(file, "png")
        return file.getvalue()

    def shows(self, *names: str) -> Bools:
        """(height, width) where the middle of a pixel shows one of the items of these ``names``."""
        wanted = [number for number, name in enumerate(self.names) if name in names]
        return np.isin(self.item, wanted)


def picture(
    items: Sequence[Item],
    veils: Sequence[Translucent],
    camera: Camera,
    theme: Theme,
    rays: int = STILL,
) -> Picture:
    """What ``camera`` sees of them. Raises ConfigurationError without embreex."""
    return _Take(items, veils, camera, theme, rays).picture


class _Take:
    """One picture on its way."""

    def __init__(
        self,
        items: Sequence[Item],
        veils: Sequence[Translucent],
        camera: Camera,
        theme: Theme,
        rays: int,
    ) -> None:
        self._solid = Scene.of(items)
        self._thin = Scene.of([veil.item for veil in veils])
        self._opacity = np.array([veil.opacity for veil in veils], dtype=np.float32)
        self._tracer, self._behind = Tracer(self._solid), Tracer(self._thin)
        self._camera, self._theme, self._rays = camera, theme, rays
        self._eye = np.array(camera.position, dtype=np.float32)

    @property
    def picture(self) -> Picture:
        width, height = self._camera.size
        rows, columns = np.divmod(np.arange(width * height, dtype=np.int32), width)
        x, y = _spots(columns, 0.5), _spots(rows, 0.5)
        sight = self._sight(x, y)
        towards = room.LAMPS[0].towards
        light = reaching(sight, self._tracer, towards, (width, height), self._rays)
        found, veil = self._light(sight, light, y)
        colours = developed(found)
        shown = np.where(veil == NOWHERE, sight.item, veil + len(self._solid.names))
        rough = np.flatnonzero(self._ends(sight, shown))
        if len(rough):
            colours[rough] = self._finer(rough, rows, columns, sight, light)
        # The background has so little contrast that its steps would show.
        plain = sight.item == NOWHERE
        finer = (TILE[rows[plain] % 4, columns[plain] % 4] - 7.5) / (16.0 * 255.0)
        colours[plain] = np.clip(colours[plain] + finer[:, None], 0.0, 1.0)
        return Picture(
            np.rint(255.0 * colours).astype(np.uint8).reshape(height, width, 3),
            shown.astype(np.int32).reshape(height, width),
            (*self._solid.names, *self._thin.names),
        )

    def _sight(self, x: Floats, y: Floats) -> Sight:
        """What is met through spots x, y (n,)."""
        ways = self._camera.directions(x, y)
        return look(self._solid, self._tracer, self._eye, ways, room.HEIGHT)

    def _light(self, sight: Sight, light: Light, y: Floats) -> tuple[Floats, Ints]:
        """(n, 3) what comes to the camera from points of which ``light`` is known.

        And (n,) which veil is before each, NOWHERE without.
        """
        found = room.background(self._theme, self._camera, y)
        on_floor = sight.item == FLOOR
        found[on_floor] = room.floor(
            self._theme,
            self._camera,
            sight.some(on_floor),
            _lit(light, on_floor),
            found[on_floor],
        )
        solid = sight.solid
        found[solid] = _surface(self._solid, sight.some(solid), _lit(light, solid))
        veil = np.full(len(found), NOWHERE, dtype=np.int32)
        if self._thin.names:
            at, seen = through(self._thin, self._behind, self._eye, sight)
            # Water is lit as what is behind it is.
            shown = _surface(self._thin, seen, Light(light.key[at], light.sky[at]))
            found[at] += self._opacity[seen.item][:, None] * (shown - found[at])
            veil[at] = seen.item
        return found, veil

    def _ends(self, sight: Sight, shown: Ints) -> Bools:
        """(n,) which pixels have a neighbour on another surface. shown: (n,) items, veils first."""
        width, height = self._camera.size
        item = shown.reshape(height, width)
        points = sight.points.reshape(height, width, 3)
        normals = sight.normals.reshape(height, width, 3)
        ends = np.zeros((height, width), dtype=bool)
        for axis in (0, 1):
            here, there = [slice(None)] * 2, [slice(None)] * 2
            here[axis], there[axis] = slice(None, -1), slice(1, None)
            one, other = tuple(here), tuple(there)
            differs = item[one] != item[other]
            bent = np.einsum("hwi,hwi->hw", normals[one], normals[other]) < BENT
            apart = points[other] - points[one]
            off = np.abs(np.einsum("hwi,hwi->hw", apart, normals[one])) > STEP
            differs |= (bent | off) & (item[one] >= 0)
            ends[one] |= differs
            ends[other] |= differs
        return ends.ravel()

    def _finer(
        self, which: npt.NDArray[np.intp], rows: Ints, columns: Ints, sight: Sight, light: Light
    ) -> Floats:
        """(k, 3) colours of pixels, each looked at four times; lit as the likest spot near by."""
        total = np.zeros((len(which), 3), dtype=np.float32)
        for right, down in CORNERS:
            x, y = _spots(columns[which], right), _spots(rows[which], down)
            seen = self._sight(x, y)
            found, _ = self._light(seen, self._near(which, seen, sight, light), y)
            total += developed(found)
        return total / np.float32(len(CORNERS))

    def _near(self, which: npt.NDArray[np.intp], seen: Sight, sight: Sight, light: Light) -> Light:
        """The light of the pixel round each whose surface is most like what is seen."""
        width, height = self._camera.size
        row, column = np.divmod(which, width)
        best = which
        least = np.full(len(which), np.inf, dtype=np.float32)
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                near = np.clip(row + down, 0, height - 1) * width
                near = near + np.clip(column + right, 0, width - 1)
                apart = np.abs(sight.points[near] - seen.points).sum(axis=1)
                turned = 1.0 - np.einsum("ni,ni->n", sight.normals[near], seen.normals)
                unlike = apart + TURN * turned + OTHER * (sight.item[near] != seen.item)
                best = np.where(unlike < least, near, best)
                least = np.minimum(unlike, least)
        return Light(light.key[best], light.sky[best])


TURN = 0.02
"""[m] That two surfaces square to each other seem to be apart."""

OTHER = 1.0
"""[m] The same of two items."""


def _spots(pixels: Ints, within: float) -> Floats:
    return np.add(pixels, within, dtype=np.float32)


def _surface(scene: Scene, sight: Sight, light: Light) -> Floats:
    stuff = Stuff(scene.colour[sight.item], scene.metallic[sight.item], scene.rough[sight.item])
    return shaded(stuff, sight.normals, sight.directions, light, room.LAMPS)


def _lit(light: Light, which: Bools) -> Light:
    return Light(light.key[which], light.sky[which])
