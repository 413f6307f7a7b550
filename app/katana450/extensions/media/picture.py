"""Rendering of a picture: one sample per pixel with light, and four more at edges."""

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
from katana450.extensions.media.hits import FLOOR, NOWHERE, Hits, first_hits, hits_behind
from katana450.extensions.media.light import TILE, Light, reaching
from katana450.extensions.media.scene import Bools, Floats, Ints, Item, RenderScene
from katana450.extensions.media.shading import SurfaceMaterial, developed, shaded
from katana450.extensions.media.tracer import Tracer
from katana450.server.viser_bridge.themes import Theme

STILL, MOVING = 4, 1
"""Rays per pixel and kind of light: of a picture, and of a frame of a film."""

CORNERS = ((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875))
"""Places of the samples in a pixel at an edge."""

EDGE_COSINE = 0.94
"""Cosine between normals of neighbours below which there is an edge."""

EDGE_STEP = 4e-3
"""[m] Distance from a neighbour's plane above which there is an edge."""


class Translucent(NamedTuple):
    """A translucent item. ``opacity`` is the fraction of the background that it hides."""

    item: Item
    opacity: float


@dataclass(frozen=True, eq=False)
class Picture:
    """A rendered picture.

    Attributes:
        pixels: (height, width, 3) sRGB, 0 to 255.
        item: (height, width) item at the middle of each pixel, FLOOR or NOWHERE.
        names: names of the items, translucent ones last.
    """

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
        """Return (height, width) whether the middle of a pixel shows one of the items ``names``."""
        numbers = [number for number, name in enumerate(self.names) if name in names]
        return np.isin(self.item, numbers)


def picture(
    items: Sequence[Item],
    translucents: Sequence[Translucent],
    camera: Camera,
    theme: Theme,
    rays: int = STILL,
) -> Picture:
    """Return the picture of the items as ``camera`` sees them.

    Raises ConfigurationError without embreex.
    """
    return _Renderer(items, translucents, camera, theme, rays).picture


class _Renderer:
    """The rendering of one picture."""

    def __init__(
        self,
        items: Sequence[Item],
        translucents: Sequence[Translucent],
        camera: Camera,
        theme: Theme,
        rays: int,
    ) -> None:
        self._solid = RenderScene.of(items)
        self._thin = RenderScene.of([translucent.item for translucent in translucents])
        self._opacity = np.array(
            [translucent.opacity for translucent in translucents], dtype=np.float32
        )
        self._tracer, self._behind = Tracer(self._solid), Tracer(self._thin)
        self._camera, self._theme, self._rays = camera, theme, rays
        self._eye = np.array(camera.position, dtype=np.float32)

    @property
    def picture(self) -> Picture:
        width, height = self._camera.size
        rows, columns = np.divmod(np.arange(width * height, dtype=np.int32), width)
        x, y = _spots(columns, 0.5), _spots(rows, 0.5)
        hits = self._hits(x, y)
        towards = room.LAMPS[0].towards
        light = reaching(hits, self._tracer, towards, (width, height), self._rays)
        found, translucent = self._light(hits, light, y)
        colours = developed(found)
        shown = np.where(translucent == NOWHERE, hits.item, translucent + len(self._solid.names))
        rough = np.flatnonzero(self._ends(hits, shown))
        if len(rough):
            colours[rough] = self._finer(rough, rows, columns, hits, light)
        # Dithering, because the low contrast of the background would show steps.
        plain = hits.item == NOWHERE
        finer = (TILE[rows[plain] % 4, columns[plain] % 4] - 7.5) / (16.0 * 255.0)
        colours[plain] = np.clip(colours[plain] + finer[:, None], 0.0, 1.0)
        return Picture(
            np.rint(255.0 * colours).astype(np.uint8).reshape(height, width, 3),
            shown.astype(np.int32).reshape(height, width),
            (*self._solid.names, *self._thin.names),
        )

    def _hits(self, x: Floats, y: Floats) -> Hits:
        """Return the hits of the rays through x, y (n,) [px]."""
        directions = self._camera.directions(x, y)
        return first_hits(self._solid, self._tracer, self._eye, directions, room.HEIGHT)

    def _light(self, hits: Hits, light: Light, y: Floats) -> tuple[Floats, Ints]:
        """Return the light (n, 3) from points with the illumination ``light`` to the camera.

        The second value (n,) is the translucent item before each point, NOWHERE without one.
        """
        found = room.background(self._theme, self._camera, y)
        on_floor = hits.item == FLOOR
        found[on_floor] = room.floor(
            self._theme,
            self._camera,
            hits.some(on_floor),
            _lit(light, on_floor),
            found[on_floor],
        )
        solid = hits.solid
        found[solid] = _surface(self._solid, hits.some(solid), _lit(light, solid))
        translucent = np.full(len(found), NOWHERE, dtype=np.int32)
        if self._thin.names:
            at, seen = hits_behind(self._thin, self._behind, self._eye, hits)
            # Water has the same illumination as the point behind it.
            shown = _surface(self._thin, seen, Light(light.key[at], light.sky[at]))
            found[at] += self._opacity[seen.item][:, None] * (shown - found[at])
            translucent[at] = seen.item
        return found, translucent

    def _ends(self, hits: Hits, shown: Ints) -> Bools:
        """Return (n,) the pixels with a neighbour on another surface; ``shown`` (n,) are items."""
        width, height = self._camera.size
        item = shown.reshape(height, width)
        points = hits.points.reshape(height, width, 3)
        normals = hits.normals.reshape(height, width, 3)
        ends = np.zeros((height, width), dtype=bool)
        for axis in (0, 1):
            here, there = [slice(None)] * 2, [slice(None)] * 2
            here[axis], there[axis] = slice(None, -1), slice(1, None)
            one, other = tuple(here), tuple(there)
            differs = item[one] != item[other]
            bent = np.einsum("hwi,hwi->hw", normals[one], normals[other]) < EDGE_COSINE
            apart = points[other] - points[one]
            off = np.abs(np.einsum("hwi,hwi->hw", apart, normals[one])) > EDGE_STEP
            differs |= (bent | off) & (item[one] >= 0)
            ends[one] |= differs
            ends[other] |= differs
        return ends.ravel()

    def _finer(
        self, which: npt.NDArray[np.intp], rows: Ints, columns: Ints, hits: Hits, light: Light
    ) -> Floats:
        """Return colours (k, 3) of pixels, four samples each, lit as the most similar pixel."""
        total = np.zeros((len(which), 3), dtype=np.float32)
        for right, down in CORNERS:
            x, y = _spots(columns[which], right), _spots(rows[which], down)
            seen = self._hits(x, y)
            found, _ = self._light(seen, self._near(which, seen, hits, light), y)
            total += developed(found)
        return total / np.float32(len(CORNERS))

    def _near(self, which: npt.NDArray[np.intp], seen: Hits, hits: Hits, light: Light) -> Light:
        """Return the light of the neighbouring pixel with the most similar surface."""
        width, height = self._camera.size
        row, column = np.divmod(which, width)
        best = which
        minimum = np.full(len(which), np.inf, dtype=np.float32)
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                near = np.clip(row + down, 0, height - 1) * width
                near = near + np.clip(column + right, 0, width - 1)
                apart = np.abs(hits.points[near] - seen.points).sum(axis=1)
                turned = 1.0 - np.einsum("ni,ni->n", hits.normals[near], seen.normals)
                unlike = (
                    apart
                    + PERPENDICULAR_PENALTY * turned
                    + OTHER_ITEM_PENALTY * (hits.item[near] != seen.item)
                )
                best = np.where(unlike < minimum, near, best)
                minimum = np.minimum(unlike, minimum)
        return Light(light.key[best], light.sky[best])


PERPENDICULAR_PENALTY = 0.02
"""[m] Distance that counts for two perpendicular surfaces."""

OTHER_ITEM_PENALTY = 1.0
"""[m] Distance that counts for two different items."""


def _spots(pixels: Ints, within: float) -> Floats:
    return np.add(pixels, within, dtype=np.float32)


def _surface(scene: RenderScene, hits: Hits, light: Light) -> Floats:
    material = SurfaceMaterial(
        scene.colour[hits.item], scene.metallic[hits.item], scene.rough[hits.item]
    )
    return shaded(material, hits.normals, hits.directions, light, room.LAMPS)


def _lit(light: Light, which: Bools) -> Light:
    return Light(light.key[which], light.sky[which])
