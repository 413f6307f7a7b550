"""The fixed jaw of a hand, against which the moving jaw pushes objects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from katana450.arm.control.grip import TOUCH_DISTANCE
from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.state import State
from katana450.maths.collision.engine import distance
from katana450.maths.collision.shape import placement
from katana450.maths.collision.world import CollisionWorld
from katana450.maths.geometry.arrays import FloatArray, frozen

MAX_PUSH: Final = 0.05
"""[m] Maximum distance of the jaw from an object that is pushed against it."""

MIN_FACE_COSINE: Final = np.cos(np.radians(45.0))
"""[1] Cosine of the angle up to which a contact lies on the face of the jaw."""

MAX_SLOPE_SINE: Final = np.sin(np.radians(6.0))
"""[1] Sine of the slope of the closing direction up to which an object slides on its support."""

OVERLAP_TOLERANCE: Final = 1e-6
"""[m] Depth by which an object that is pushed may enter another: the rounding of distances."""


@dataclass(frozen=True, eq=False)
class FixedJaw:
    """A body of the palm, as `FixedJawModel`.

    Attributes:
        name: of the part whose face is nearest to the moving jaw.
        palm: index of the group of the palm in the linkage.
        y: (3,) unit vector in the frame of the palm, from this jaw to the moving one.
    """

    name: str
    palm: int
    y: FloatArray

    def met(
        self, world: CollisionWorld, state: State, item: SceneObject
    ) -> tuple[str, float, SceneObject | None]:
        """Return name and distance [m] of the jaw, and the object pushed towards it.

        The name is that of the part of the palm that is nearest to the object, and the distance is
        at least MAX_PUSH if the object is not before its face. The pushed object is in the base
        frame. It is None if it touches the jaw already, is not before its face, or cannot be
        pushed: uphill, or into another object.
        """
        y = np.asarray(world.linkage.poses(state.x_setpoint)[self.palm, :3, :3] @ self.y)
        distance, name = self._nearest(world, state.x_setpoint, item.name, y)
        if not TOUCH_DISTANCE < distance < MAX_PUSH or abs(float(y[2])) > MAX_SLOPE_SINE:
            return name, distance, None
        T = item.T.copy()
        T[:2, 3] -= TOUCH_DISTANCE * y[:2]
        pushed = replace(item, T=frozen(T))
        others = [
            neighbour
            for neighbour in state.objects
            if neighbour is not item and not neighbour.carried
        ]
        blocked = any(_overlaps_more(pushed, item, neighbour) for neighbour in others)
        return name, distance, None if blocked else pushed

    def _nearest(
        self, world: CollisionWorld, x: FloatArray, name: str, y: FloatArray
    ) -> tuple[float, str]:
        """Return the distance [m] of an object from the face of the jaw, and the nearest part.

        It is at least MAX_PUSH if the object is not before the face.

        y: (3,) as ``y`` of this jaw, in the base frame.
        """
        number, placed = [part.name for part in world.parts].index(name), world.at(x)
        nearest = MAX_PUSH, self.name
        for pair in placed.nearer_than(MAX_PUSH)[0].tolist():
            one, other = (
                int(world.part_of[bodies[pair]]) for bodies in (world.first, world.second)
            )
            if other == number and world.parts[one].mover == self.palm:
                contact = placed.contact(pair)
                if float(contact.normal @ y) >= MIN_FACE_COSINE:
                    nearest = min(nearest, (contact.distance, contact.parts[0]))
        return nearest


def _overlaps_more(pushed: SceneObject, item: SceneObject, other: SceneObject) -> bool:
    """Return whether ``item`` overlaps ``other`` more once it is ``pushed``.

    Objects that stand on each other overlap by rounding.
    """
    gap = _gap(pushed, other)
    return gap < -OVERLAP_TOLERANCE and gap < _gap(item, other) - OVERLAP_TOLERANCE


def _gap(one: SceneObject, other: SceneObject) -> float:
    """Return the distance [m] of two objects that are not held; negative if they overlap."""
    shapes = (
        (scene_object.collision_shape, scene_object.T_collision_shape)
        for scene_object in (one, other)
    )
    return distance(placement(*shapes), 0, 1)
