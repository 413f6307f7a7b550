"""The first intersection of camera rays: with a surface of an item, the floor, or nothing."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from katana450.extensions.media.scene import Bools, Floats, Ints, RenderScene
from katana450.extras import require

NOTHING = -1
"""Triangle number of a ray that hits nothing."""


def check_traceable() -> None:
    """Raise MissingExtraError if embreex is missing, to report this before a long run."""
    require("embreex", "pictures", "Pictures and films")


class Meeting(NamedTuple):
    """The first triangles that n rays hit.

    Attributes:
        face: (n,) number of the triangle, or NOTHING.
        distance: (n,) [m], infinite without a hit.
        second: (n,) barycentric coordinate of its second corner.
        third: (n,) barycentric coordinate of its third corner.
    """

    face: Ints
    distance: Floats
    second: Floats
    third: Floats


class Tracer:
    """A scene prepared for ray queries."""

    def __init__(self, scene: RenderScene) -> None:
        """Build the acceleration structure. Raises MissingExtraError without embreex."""
        check_traceable()
        rtcore: Any = import_module("embreex.rtcore_scene")
        meshes: Any = import_module("embreex.mesh_construction")
        self._scene = rtcore.EmbreeScene()
        self._empty = not len(scene.faces)
        if not self._empty:
            meshes.TriangleMesh(self._scene, scene.vertices, scene.faces)

    def first(self, origins: Floats, directions: Floats) -> Meeting:
        """Return the first hits of rays from ``origins`` (n, 3) [m] along ``directions`` (n, 3)."""
        count = len(origins)
        if self._empty or not count:
            nowhere = np.full(count, np.inf, dtype=np.float32)
            zero = np.zeros(count, dtype=np.float32)
            return Meeting(np.full(count, NOTHING, dtype=np.int32), nowhere, zero, zero)
        found = self._scene.run(origins, directions, output=True)
        face: Ints = found["primID"]
        distance = np.where(face == NOTHING, np.float32(np.inf), found["tfar"])
        return Meeting(face, distance, found["u"], found["v"])

    def blocked(self, origins: Floats, directions: Floats, reach: float) -> Bools:
        """Return (n,) whether each ray hits anything within ``reach`` [m]."""
        if self._empty or not len(origins):
            return np.zeros(len(origins), dtype=bool)
        reached = np.full(len(origins), reach, dtype=np.float32)
        found = self._scene.run(origins, directions, dists=reached, query="OCCLUDED")
        return np.asarray(found != NOTHING)


FLOOR, NOWHERE = -1, -2
"""Values in place of the number of an item."""

BACKGROUND_DISTANCE = 1e4
"""[m] Distance that is assigned to rays that hit nothing."""

MAX_SHADOW_LENGTH = 2.5
"""[m] Maximum length of a shadow."""

RAY_OFFSET = 2e-4
"""[m] Distance of the start of a shadow ray from its surface, to avoid hits of that surface."""


@dataclass(frozen=True, eq=False)
class Hits:
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
        return Hits(
            self.directions[which],
            self.distance[which],
            self.points[which],
            self.normals[which],
            self.item[which],
        )


def first_hits(
    scene: RenderScene, tracer: Tracer, eye: Floats, directions: Floats, floor: float
) -> Hits:
    """Return the hits of rays from ``eye`` (3,) along ``directions`` (n, 3).

    ``floor`` is the height of the floor [m].
    """
    meeting = tracer.first(_from(eye, directions), directions)
    down = directions[:, 2]
    to_floor = np.full(len(directions), BACKGROUND_DISTANCE, dtype=np.float32)
    np.divide(floor - eye[2], down, out=to_floor, where=down < -STEEPNESS)
    nearest = np.minimum(meeting.distance, BACKGROUND_DISTANCE)
    on_floor = (to_floor > 0.0) & (to_floor < nearest)
    distance = np.where(on_floor, to_floor, nearest).astype(np.float32)
    hit = np.flatnonzero(meeting.face != NOTHING)
    normals = np.zeros_like(directions)
    normals[:, 2] = 1.0
    normals[hit] = _normals(scene, meeting, directions, hit)
    item = np.where(on_floor, FLOOR, NOWHERE).astype(np.int32)
    item[hit] = scene.item[meeting.face[hit]]
    return Hits(directions, distance, _ends(eye, distance, directions), normals, item)


def hits_behind(
    scene: RenderScene, tracer: Tracer, eye: Floats, before: Hits
) -> tuple[np.typing.NDArray[np.intp], Hits]:
    """Return the numbers (m,) of rays that hit another scene ``before`` they end, and the hits."""
    meeting = tracer.first(_from(eye, before.directions), before.directions)
    hit = np.flatnonzero(meeting.distance < before.distance)
    directions, distance = before.directions[hit], meeting.distance[hit]
    normals = _normals(scene, meeting, before.directions, hit)
    points = _ends(eye, distance, directions)
    return hit, Hits(directions, distance, points, normals, scene.item[meeting.face[hit]])


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
    scene: RenderScene, meeting: Meeting, directions: Floats, hit: np.typing.NDArray[np.intp]
) -> Floats:
    """Return smooth unit normals (m, 3) at the ends of the rays ``hit``."""
    face = meeting.face[hit]
    a, b, c = (scene.normals[scene.faces[face, corner]] for corner in range(3))
    second, third = meeting.second[hit, None], meeting.third[hit, None]
    smooth = a + second * (b - a) + third * (c - a)
    size = np.sqrt(np.einsum("ni,ni->n", smooth, smooth))[:, None]
    plane = scene.flat[face]
    # An open surface can be seen from both sides.
    inside = np.einsum("ni,ni->n", plane, directions[hit]) > 0.0
    side = np.where(inside, np.float32(-1.0), np.float32(1.0))[:, None]
    shaded = np.where(size > MIN_DENOMINATOR, smooth / np.maximum(size, MIN_DENOMINATOR), plane)
    return np.asarray(side * shaded, dtype=np.float32)


STEEPNESS = 1e-6
"""Sine of the inclination below which a ray counts as level."""

MIN_DENOMINATOR = np.float32(1e-6)
"""Minimum length of a vector that can be normalized."""
