"""Rendering of a picture: one sample per pixel, and four at edges of surfaces and shadows."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from katana450.extensions.media.camera import Camera
from katana450.extensions.media.hits import (
    FLOOR,
    NOWHERE,
    Hits,
    Tracer,
    first_hits,
    hits_behind,
    lit,
)
from katana450.extensions.media.scene import Bools, Floats, Ints, Item, RenderScene
from katana450.extensions.media.shading import (
    LAMPS,
    background,
    developed,
    dithered,
    floor_light,
    shaded,
)
from katana450.server.view.room import FLOOR_AT
from katana450.server.viser_bridge.themes import Theme

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
    items: Sequence[Item], translucents: Sequence[Translucent], camera: Camera, theme: Theme
) -> Picture:
    """Return the picture of the items as ``camera`` sees them.

    Raises MissingExtraError without embreex.
    """
    return _Renderer(items, translucents, camera, theme).picture


class _Samples(NamedTuple):
    """The colours that n rays show, and where they end.

    Attributes:
        colours: (n, 3) sRGB, 0 to 1.
        hits: first intersections with opaque surfaces.
        item: (n,) what is seen there, also a translucent item.
        lit: (n,) whether the key light reaches the points.
    """

    colours: Floats
    hits: Hits
    item: Ints
    lit: Bools


class _Renderer:
    """The rendering of one picture."""

    def __init__(
        self,
        items: Sequence[Item],
        translucents: Sequence[Translucent],
        camera: Camera,
        theme: Theme,
    ) -> None:
        self._solid = RenderScene.of(items)
        self._thin = RenderScene.of([translucent.item for translucent in translucents])
        self._opacity = np.array(
            [translucent.opacity for translucent in translucents], dtype=np.float32
        )
        self._tracer, self._behind = Tracer(self._solid), Tracer(self._thin)
        self._camera, self._theme = camera, theme
        self._eye = np.array(camera.position, dtype=np.float32)

    @property
    def picture(self) -> Picture:
        width, height = self._camera.size
        rows, columns = np.divmod(np.arange(width * height, dtype=np.int32), width)
        samples = self._samples(_spots(columns, 0.5), _spots(rows, 0.5))
        colours = samples.colours
        edge = np.flatnonzero(self._edges(samples))
        if len(edge):
            colours[edge] = sum(
                self._samples(_spots(columns[edge], right), _spots(rows[edge], down)).colours
                for right, down in CORNERS
            ) / np.float32(len(CORNERS))
        plain = samples.item == NOWHERE
        colours[plain] = dithered(colours[plain], rows[plain], columns[plain])
        return Picture(
            np.rint(255.0 * colours).astype(np.uint8).reshape(height, width, 3),
            samples.item.reshape(height, width),
            (*self._solid.names, *self._thin.names),
        )

    def _samples(self, x: Floats, y: Floats) -> _Samples:
        """Return what the rays through x, y (n,) [px] show."""
        directions = self._camera.directions(x, y)
        hits = first_hits(self._tracer, self._eye, directions, FLOOR_AT)
        reached = lit(self._tracer, hits, LAMPS[0].towards)
        light = background(self._theme, self._camera, y)
        floor, solid = hits.item == FLOOR, hits.item >= 0
        light[floor] = floor_light(
            self._theme, self._camera, hits.some(floor), reached[floor], light[floor]
        )
        light[solid] = _surface(self._solid, hits.some(solid), reached[solid])
        item = hits.item.copy()
        if self._thin.names:
            which, surface = hits_behind(self._behind, self._eye, hits)
            # Water has the same illumination as the point behind it.
            shown = _surface(self._thin, surface, reached[which])
            light[which] += self._opacity[surface.item][:, None] * (shown - light[which])
            item[which] = surface.item + len(self._solid.names)
        return _Samples(developed(light), hits, item, reached)

    def _edges(self, samples: _Samples) -> Bools:
        """Return (n,) the pixels with a neighbour on another surface, or in another light."""
        width, height = self._camera.size
        item, reached = samples.item.reshape(height, width), samples.lit.reshape(height, width)
        points = samples.hits.points.reshape(height, width, 3)
        normals = samples.hits.normals.reshape(height, width, 3)
        edges = np.zeros((height, width), dtype=bool)
        for axis in (0, 1):
            here, there = [slice(None)] * 2, [slice(None)] * 2
            here[axis], there[axis] = slice(None, -1), slice(1, None)
            one, other = tuple(here), tuple(there)
            differs = (item[one] != item[other]) | (reached[one] != reached[other])
            bent = np.einsum("hwi,hwi->hw", normals[one], normals[other]) < EDGE_COSINE
            apart = points[other] - points[one]
            off = np.abs(np.einsum("hwi,hwi->hw", apart, normals[one])) > EDGE_STEP
            differs |= (bent | off) & (item[one] >= 0)
            edges[one] |= differs
            edges[other] |= differs
        return edges.ravel()


def _spots(pixels: Ints, within: float) -> Floats:
    return np.add(pixels, within, dtype=np.float32)


def _surface(scene: RenderScene, hits: Hits, reached: Bools) -> Floats:
    return shaded(scene.colour[hits.item], hits.normals, reached)
