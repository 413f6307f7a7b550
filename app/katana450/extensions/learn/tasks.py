"""Tasks on the table: the scene in which each begins, drawn at random."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from katana450.arm.control.objects.pouring import BASIN, CUP
from katana450.arm.control.state.scene_objects import SceneObject, Shape, named
from katana450.errors import InputError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.units import ML

TASKS = {"PickPlace": ("cube",), "Stack": ("upper", "lower"), "Pour": (CUP, BASIN)}
"""Names of the objects that are observed in each task. The first one is to be grasped."""

SIDE = 0.04
"""[m] Length of a side of the cubes."""

FILLED, WANTED = 100.0, 50.0
"""[ml] Water in the cup at the start, and in the basin at success."""

RADIUS = 0.75, 1.0
"""[1] Range of the distances of places from axis 1, as ratios to that of the tool when ready."""

MAX_AZIMUTH, MAX_YAW = 0.6, 0.2
"""[rad] Maximum angle of a place beside the tool when ready, and of an object to its radius."""

ROOM = 0.12
"""[m] Minimum distance between the middles of two places: the fingers fit between them."""


class Scene(NamedTuple):
    """A first scene, with the water in its cup [m^3].

    ``goal``: (3,) where the first object is to stand [m], from the second one if there is one.
    """

    objects: tuple[SceneObject, ...]
    goal: FloatArray
    volume: float | None = None


class Table:
    """The part of the table before an arm in which objects are placed."""

    def __init__(self, tool: FloatArray, axis: FloatArray, rng: np.random.Generator) -> None:
        """Create it without a place. ``tool``: place of the tool, ``axis``: of axis 1, (3,) [m]."""
        (x, y), self._axis, self._rng = (tool - axis)[:2], axis[:2], rng
        self._radius, self._azimuth = math.hypot(x, y), math.atan2(y, x)
        self._places: list[FloatArray] = []

    def scene(self, task: str, objects: tuple[SceneObject, ...]) -> Scene:
        """Return a random scene of ``task``; ``objects``: those of the app."""
        if task == "PickPlace":
            return Scene((self._cube("cube"),), self._draw()[:3, 3])
        if task == "Stack":
            return Scene((self._cube("upper"), self._cube("lower")), np.array((0.0, 0.0, SIDE)))
        cup, basin = named(objects, CUP), named(objects, BASIN)
        if cup is None or basin is None:
            raise InputError("There is no cup or basin for this arm. Choose another task.")
        return Scene((replace(cup, T=self._draw()), basin), np.zeros(3), FILLED * ML)

    def _cube(self, name: str) -> SceneObject:
        return SceneObject(name, Shape.BOX, (SIDE,) * 3, self._draw(), can_be_held=True)

    def _draw(self) -> FloatArray:
        """Return the pose (4, 4) of an object with room around it."""
        while True:
            azimuth = self._azimuth + self._rng.uniform(-MAX_AZIMUTH, MAX_AZIMUTH)
            radius = self._radius * self._rng.uniform(*RADIUS)
            place = self._axis + radius * np.array((math.cos(azimuth), math.sin(azimuth)))
            yaw = azimuth + self._rng.uniform(-MAX_YAW, MAX_YAW)
            # An arm too small for the room gets places without it.
            room = min(ROOM, 0.5 * MAX_AZIMUTH * self._radius)
            if all(math.dist(place, other) > room for other in self._places):
                self._places.append(place)
                return se3.from_rotation_translation(so3.rotation_z(yaw), (*place, 0.0))
