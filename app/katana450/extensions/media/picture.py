"""Rendering of a picture: one sample per pixel, and four at edges of surfaces and shadows.

The light is that of the page's room: from surfaces by Lambert's cosine, from the floor and the
background. Three lamps and a bright sky light it.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from katana450.extensions.media.scene import (
    FLOOR,
    Bools,
    Camera,
    Floats,
    Hits,
    Ints,
    Item,
    RenderScene,
    Tracer,
    first_hits,
    hits_behind,
    lit,
    unit,
)
from katana450.server.viser_bridge.themes import FILL, FLOOR_AT, KEY, LIGHT, RIM
from katana450.srgb import to_light, to_srgb

CELLS = ((0.05, 0.6), (0.25, 1.0))
"""Distance [m] and width [px] of the lines on the floor: fine lines, and main lines."""

FADE_DISTANCE = 5.0
"""[m] Distance at which the floor has faded to the background."""


def background(camera: Camera, y: Floats) -> Floats:
    """Return the light (n, 3) of the background at rows ``y`` (n,) [px] of the picture."""
    fraction = np.clip(y / camera.size[1], 0.0, 1.0)[:, None]
    top, bottom = (np.array(c, dtype=np.float32) / 255.0 for c in (LIGHT.sky, LIGHT.floor))
    return to_light(top + fraction * (bottom - top)).astype(np.float32)


def floor_light(camera: Camera, hits: Hits, lit: Bools, behind: Floats) -> Floats:
    """Return the light (n, 3) of points on the floor, faded to the background ``behind`` (n, 3)."""
    colour = np.tile(np.array(LIGHT.floor, dtype=np.float32) / 255.0, (len(hits.points), 1))
    for (apart, wide), line in zip(CELLS, (LIGHT.cell, LIGHT.section), strict=True):
        fraction = _lines(camera, hits, apart, wide)[:, None]
        colour += fraction * (np.array(line, dtype=np.float32) / 255.0 - colour)
    colour[~lit] *= 1.0 - LIGHT.shadow
    shown = to_light(colour)
    east, north = (hits.points[:, :2] - np.array(camera.position[:2], dtype=np.float32)).T
    left = np.clip(1.0 - np.hypot(east, north) / FADE_DISTANCE, 0.0, 1.0)[:, None]
    return np.asarray(behind + left * (shown - behind), dtype=np.float32)


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
        place = hits.points[:, axis] / apart
        off = np.abs(place - np.round(place)) * apart / moved
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
    for number, source in enumerate(LAMPS):
        cosine = np.maximum(normals @ source.towards, 0.0)
        total += (cosine * lit if number == 0 else cosine)[:, None] * source.colour
    return np.asarray((SHEEN + (1.0 - SHEEN) * colour) * total, dtype=np.float32)


def developed(light: Floats) -> Floats:
    """Return light as sRGB 0..1: unchanged up to the shoulder, then softly up to white."""
    over = np.maximum(light - SHOULDER, 0.0) / (1.0 - SHOULDER)
    soft = SHOULDER + (1.0 - SHOULDER) * (1.0 - np.exp(-over))
    return to_srgb(np.where(light > SHOULDER, soft, light)).astype(np.float32)


SHOULDER = 0.75
"""Linear value above which highlights are compressed."""


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


def picture(items: Sequence[Item], translucents: Sequence[Translucent], camera: Camera) -> Picture:
    """Return the picture of the items as ``camera`` sees them.

    Raises MissingExtraError without embreex.
    """
    return _Renderer(items, translucents, camera).picture


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
        self, items: Sequence[Item], translucents: Sequence[Translucent], camera: Camera
    ) -> None:
        self._solid = RenderScene.of(items)
        self._thin = RenderScene.of([translucent.item for translucent in translucents])
        self._opacity = np.array(
            [translucent.opacity for translucent in translucents], dtype=np.float32
        )
        self._tracer, self._behind = Tracer(self._solid), Tracer(self._thin)
        self._camera = camera
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
        light = background(self._camera, y)
        floor, solid = hits.item == FLOOR, hits.item >= 0
        light[floor] = floor_light(self._camera, hits.some(floor), reached[floor], light[floor])
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
            first, second = [slice(None)] * 2, [slice(None)] * 2
            first[axis], second[axis] = slice(None, -1), slice(1, None)
            one, other = tuple(first), tuple(second)
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
