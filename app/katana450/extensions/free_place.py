"""Place of a new object on the table, beside the objects there: before the arm, or near a point."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from katana450.arm.control.state.scene_objects import SceneObject
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray

MIN_DISTANCE, MAX_DISTANCE = 0.36, 0.60
"""[m] Distance of its middle from axis 1: in reach, and clear of the arm in its ready posture."""

OBJECT_GAP = 0.02
"""[m] Minimum gap between two objects."""

RADII = (0.0, 0.03, 0.06, 0.09, 0.12, 0.15)
"""[m] Distances from a point that is wanted, at which a place is tried."""

AZIMUTHS = tuple(math.radians(sign * angle) for angle in range(0, 110, 12) for sign in (1, -1))
"""[rad] Directions to try, from straight ahead outwards to both sides."""


def free_place(
    scene_object: SceneObject,
    objects: Sequence[SceneObject],
    table: float = 0.0,
    near: tuple[float, float] | None = None,
) -> FloatArray:
    """Return the pose (4, 4) in the base frame of a free place for ``scene_object``.

    The place is straight ahead if there is room, else aside, else farther out; with ``near`` (x, y)
    [m] it is near that point. If there is room nowhere, it is straight ahead. All places are clear
    of the arm in its ready posture, and of other objects. ``table``: its height [m].
    """
    others = [
        neighbour
        for neighbour in objects
        if neighbour.name != scene_object.name and not neighbour.carried
    ]
    places = [
        (distance * math.cos(azimuth), distance * math.sin(azimuth))
        for distance in np.arange(MIN_DISTANCE, MAX_DISTANCE, 0.06).tolist()
        for azimuth in AZIMUTHS
    ]
    if near is not None:
        round_it = (
            (near[0] + radius * math.cos(azimuth), near[1] + radius * math.sin(azimuth))
            for radius in RADII
            for azimuth in np.linspace(0.0, math.tau, 12, endpoint=False).tolist()
        )
        clear = [place for place in round_it if math.hypot(*place) >= MIN_DISTANCE]
        places = [*clear, *sorted(places, key=lambda place: math.dist(place, near))]
    for place in places:
        gaps = (
            math.dist(neighbour.T[:2, 3], place) - girth(neighbour) - girth(scene_object)
            for neighbour in others
        )
        if all(gap >= OBJECT_GAP for gap in gaps):
            return se3.from_rotation_translation(np.eye(3), (*place, table))
    return se3.from_rotation_translation(np.eye(3), (MIN_DISTANCE, 0.0, table))


def girth(scene_object: SceneObject) -> float:
    """Return the radius [m] of an upright object about its middle, seen from above."""
    if scene_object.shape.is_round:
        return scene_object.extent[0]
    return 0.5 * math.hypot(*scene_object.extent[:2])
