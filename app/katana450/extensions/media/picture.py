"""Rendering of a picture: the first triangles that the rays of a camera hit, and their light.

There is one sample per pixel, and four at edges of surfaces and shadows. The light is that of the
page's room: from surfaces by Lambert's cosine, from the floor and the background. Three lamps and a
bright sky light it.
"""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from katana450.arm.robot.surfaces import VisualMesh
from katana450.caching import cached_property
from katana450.extras import require
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.viser_bridge.themes import FILL, FLOOR_AT, KEY, LIGHT, RIM
from katana450.srgb import to_light, to_srgb

Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int32]
Bools = npt.NDArray[np.bool_]

Pixels = npt.NDArray[np.uint8]
"""A picture: (height, width, 3) sRGB, 0 to 255."""


class Item(NamedTuple):
    """A shape in the scene.

    Attributes:
        shape: the mesh.
        T: (4, 4) pose of the mesh in the base frame [m].
    """

    shape: VisualMesh
    T: FloatArray


@dataclass(frozen=True, eq=False)
class RenderScene:
    """All triangles of a scene.

    Attributes:
        vertices: (v, 3) in the base frame [m].
        normals: (v, 3) unit normals.
        faces: (f, 3) corners, counter-clockwise seen from outside.
        item: (f,) item of each triangle.
        colour: (i, 3) linear colour of each item.
    """

    vertices: Floats
    normals: Floats
    faces: Ints
    item: Ints
    colour: Floats

    @classmethod
    def of(cls, items: Sequence[Item]) -> RenderScene:
        """Return the scene of ``items``."""
        shapes = [item.shape for item in items]
        starts = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
        turned = [(item.shape, item.T[:3, :3].T, item.T[:3, 3]) for item in items]
        materials = [shape.material for shape in shapes]
        return cls(
            _stacked([shape.vertices @ R + p for shape, R, p in turned], np.float32),
            _stacked([shape.normals @ R for shape, R, _ in turned], np.float32),
            _stacked(
                [s.faces + start for s, start in zip(shapes, starts[:-1], strict=True)], np.int32
            ),
            np.repeat(np.arange(len(shapes)), [len(shape.faces) for shape in shapes]).astype("i4"),
            _stacked([[to_light(material.colour) for material in materials]], np.float32),
        )

    @cached_property
    def flat(self) -> Floats:
        """The unit normals (f, 3) of the triangles; 0 for a triangle without area."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return unit(np.cross(b - a, c - a))


def unit(v: npt.NDArray[Any]) -> Floats:
    """Return vectors (..., 3) scaled to length 1; zero vectors stay 0."""
    length = np.sqrt(np.einsum("...i,...i->...", v, v))[..., None]
    units = np.divide(v, length, out=np.zeros_like(v), where=length > 0.0)
    return np.asarray(units, dtype=np.float32)


def _stacked(parts: Sequence[Any], kind: Any) -> npt.NDArray[Any]:
    if not parts or not len(parts[0]):
        return np.empty((0, 3), dtype=kind)
    return np.concatenate(parts).astype(kind)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera, which does not look along its ``up``.

    Attributes:
        position: [m] in the base frame, z up.
        target: point that it looks at [m].
        fov: vertical field of view [rad].
        size: width and height of its picture [px].
        up: direction that is up in the picture, in the base frame.
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float
    size: tuple[int, int]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @cached_property
    def frame(self) -> Floats:
        """The rows (3, 3) of its axes in the base frame: right, up and ahead."""
        forward = unit(np.subtract(self.target, self.position))
        right = unit(np.cross(forward, self.up))
        return np.stack((right, np.cross(right, forward), forward)).astype(np.float32)

    @property
    def pixel(self) -> float:
        """The width of the central pixel, as a fraction of the distance."""
        return 2.0 * math.tan(0.5 * self.fov) / self.size[1]

    def directions(self, x: Floats, y: Floats) -> Floats:
        """Return unit directions (n, 3) through x, y (n,) [px] from the top left corner."""
        width, height = self.size
        across = (x - 0.5 * width) * self.pixel
        up = (0.5 * height - y) * self.pixel
        return unit(np.stack((across, up, np.ones_like(across)), axis=1) @ self.frame)


NOTHING = -1
"""Triangle number of a ray that hits nothing."""


def check_traceable() -> None:
    """Raise MissingExtraError if embreex is missing, to report this before a long run."""
    require("embreex", "pictures", "Pictures and films")


FLOOR, NOWHERE = -1, -2
"""Values in place of the number of an item."""

BACKGROUND_DISTANCE = 1e4
"""[m] Distance that is assigned to rays that hit nothing."""

MAX_SHADOW_LENGTH = 2.5
"""[m] Maximum length of a shadow."""

RAY_OFFSET = 2e-4
"""[m] Distance of the start of a shadow ray from its surface, to avoid hits of that surface."""


class Hits(NamedTuple):
    """The first intersections of n rays.

    Attributes:
        directions: (n, 3) of the rays.
        distance: (n,) [m].
        points: (n, 3) end points in the base frame [m].
        normals: (n, 3) unit normals, towards the camera.
        item: (n,) numbers of items, FLOOR or NOWHERE.
    """

    directions: Floats
    distance: Floats
    points: Floats
    normals: Floats
    item: Ints

    def some(self, which: Bools) -> Hits:
        """Return the hits of the rays for which ``which`` (n,) is True."""
        return Hits._make(values[which] for values in self)


class Tracer:
    """A scene prepared for ray queries."""

    def __init__(self, scene: RenderScene) -> None:
        """Build the acceleration structure. Raises MissingExtraError without embreex."""
        check_traceable()
        rtcore: Any = import_module("embreex.rtcore_scene")
        meshes: Any = import_module("embreex.mesh_construction")
        self._scene, self._embree = scene, rtcore.EmbreeScene()
        self._empty = not len(scene.faces)
        if not self._empty:
            meshes.TriangleMesh(self._embree, scene.vertices, scene.faces)

    def hits(self, eye: Floats, directions: Floats) -> Hits:
        """Return the hits of rays from ``eye`` (3,) [m] along ``directions`` (n, 3)."""
        count = len(directions)
        distance = np.full(count, BACKGROUND_DISTANCE, dtype=np.float32)
        item = np.full(count, NOWHERE, dtype=np.int32)
        normals = np.tile(UPWARD, (count, 1))
        if not self._empty and count:
            hits = self._embree.run(_from(eye, directions), directions, output=True)
            face: Ints = hits["primID"]
            hit = np.flatnonzero(face != NOTHING)
            distance[hit] = np.minimum(hits["tfar"][hit], BACKGROUND_DISTANCE)
            item[hit] = self._scene.item[face[hit]]
            places = (hits["u"][hit, None], hits["v"][hit, None])
            normals[hit] = _normals(self._scene, face[hit], places, directions[hit])
        return Hits(directions, distance, _ends(eye, distance, directions), normals, item)

    def blocked(self, origins: Floats, directions: Floats, reach: float) -> Bools:
        """Return (n,) whether each ray hits anything within ``reach`` [m]."""
        if self._empty or not len(origins):
            return np.zeros(len(origins), dtype=bool)
        reached = np.full(len(origins), reach, dtype=np.float32)
        faces = self._embree.run(origins, directions, dists=reached, query="OCCLUDED")
        return np.asarray(faces != NOTHING)


def first_hits(tracer: Tracer, eye: Floats, directions: Floats, floor: float) -> Hits:
    """Return the hits of rays from ``eye`` (3,) along ``directions`` (n, 3).

    ``floor`` is the height of the floor [m].
    """
    hits = tracer.hits(eye, directions)
    down = directions[:, 2]
    to_floor = np.full(len(directions), BACKGROUND_DISTANCE, dtype=np.float32)
    np.divide(floor - eye[2], down, out=to_floor, where=down < -STEEPNESS)
    on_floor = (to_floor > 0.0) & (to_floor < hits.distance)
    distance = np.where(on_floor, to_floor, hits.distance).astype(np.float32)
    return hits._replace(
        distance=distance,
        points=_ends(eye, distance, directions),
        normals=np.where(on_floor[:, None], UPWARD, hits.normals),
        item=np.where(on_floor, FLOOR, hits.item).astype(np.int32),
    )


def hits_behind(
    tracer: Tracer, eye: Floats, before: Hits
) -> tuple[np.typing.NDArray[np.intp], Hits]:
    """Return the numbers (m,) of rays that hit another scene ``before`` they end, and the hits."""
    hits = tracer.hits(eye, before.directions)
    nearer = hits.distance < before.distance
    return np.flatnonzero(nearer), hits.some(nearer)


def lit(tracer: Tracer, hits: Hits, towards: Floats) -> Bools:
    """Return (n,) whether the lamp in the direction ``towards`` (3,) reaches each point."""
    reached: Bools = (hits.item != NOWHERE) & (hits.normals @ towards > 0.0)
    facing = np.flatnonzero(reached)
    start = (hits.points[facing] + RAY_OFFSET * hits.normals[facing]).astype(np.float32)
    reached[facing] = ~tracer.blocked(start, _from(towards, facing), MAX_SHADOW_LENGTH)
    return reached


def _from(vector: Floats, rays: np.typing.NDArray[np.generic]) -> Floats:
    """Return ``vector`` (3,) for each of the ``rays``."""
    return np.tile(vector, (len(rays), 1))


def _ends(eye: Floats, distance: Floats, directions: Floats) -> Floats:
    return np.asarray(eye + distance[:, None] * directions, dtype=np.float32)


def _normals(
    scene: RenderScene, face: Ints, places: tuple[Floats, Floats], directions: Floats
) -> Floats:
    """Return smooth unit normals (m, 3) on the triangles ``face`` (m,), towards the camera.

    places: barycentric coordinates (m, 1) of the second and third corner.
    """
    a, b, c = (scene.normals[scene.faces[face, corner]] for corner in range(3))
    smooth = a + places[0] * (b - a) + places[1] * (c - a)
    size = np.sqrt(np.einsum("ni,ni->n", smooth, smooth))[:, None]
    plane = scene.flat[face]
    # An open surface can be seen from both sides.
    inside = np.einsum("ni,ni->n", plane, directions) > 0.0
    side = np.where(inside, np.float32(-1.0), np.float32(1.0))[:, None]
    shaded = np.where(size > MIN_DENOMINATOR, smooth / np.maximum(size, MIN_DENOMINATOR), plane)
    return np.asarray(side * shaded, dtype=np.float32)


UPWARD = np.array((0.0, 0.0, 1.0), dtype=np.float32)
"""The normal of the floor, and of what no ray hits."""

STEEPNESS = 1e-6
"""Sine of the inclination below which a ray counts as level."""

MIN_DENOMINATOR = np.float32(1e-6)
"""Minimum length of a vector that can be normalized."""

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
    colour[~lit] *= 1.0 - LIGHT.shadow
    shown = to_light(colour)
    east, north = (hits.points[:, :2] - np.array(camera.position[:2], dtype=np.float32)).T
    left = np.clip(1.0 - np.hypot(east, north) / FADE_DISTANCE, 0.0, 1.0)[:, None]
    return np.asarray(behind + left * (shown - behind), dtype=np.float32)


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


def png(pixels: Pixels) -> bytes:
    """Return ``pixels`` as a PNG file; the same pixels give the same bytes."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    return file.getvalue()


def picture(items: Sequence[Item], translucents: Sequence[Translucent], camera: Camera) -> Pixels:
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
    def picture(self) -> Pixels:
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
        pixels = np.rint(255.0 * colours).astype(np.uint8)
        return np.asarray(pixels.reshape(height, width, 3))

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
        if len(self._opacity):
            which, surface = hits_behind(self._behind, self._eye, hits)
            # Water has the same illumination as the point behind it.
            shown = _surface(self._thin, surface, reached[which])
            light[which] += self._opacity[surface.item][:, None] * (shown - light[which])
            item[which] = surface.item + len(self._solid.colour)
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
