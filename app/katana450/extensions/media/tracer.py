"""Intersection of rays and triangles, by Embree."""

from __future__ import annotations

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
