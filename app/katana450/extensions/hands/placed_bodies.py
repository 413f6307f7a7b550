"""Bodies of a hand at one place of its fingers, in the frame of the palm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from katana450.caching import cached_property
from katana450.maths.collision.contact import Witness
from katana450.maths.collision.shape import half_space, sphere
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray

PLANE_DISTANCE: Final = 10.0
"""[m] Distance of the planes from which the extent of bodies is measured."""

PROBE_RADIUS: Final = 1e-5
"""[m] Radius of the ball that stands for a point."""


class PlacedBodies:
    """Bodies placed in the frame of the palm.

    Attributes:
        middle: (3,) the mean of their middles [m].
    """

    def __init__(
        self, world: CollisionWorld, parts: Sequence[Part], palm: int, gripper: float
    ) -> None:
        """Place ``parts`` with the finger joint at ``gripper`` [rad or m].

        ``palm``: index of the group of the palm in the linkage of ``world``.
        """
        T = world.linkage.poses(np.append(np.zeros(int(world.linkage.variable.max())), gripper))
        self._T, self._T_palm_base = T, se3.inverse(T[palm])
        placed = [
            (shape, self._T_palm_base @ T[part.mover] @ T_mover_shape)
            for part in parts
            for T_mover_shape, shape in zip(part.T_mover_shape, part.shapes, strict=True)
        ]
        self._world, self._bodies = world, placed
        middles = [T[:3, :3] @ shape.centre + T[:3, 3] for shape, T in placed]
        self.middle: FloatArray = np.mean(middles, axis=0) if middles else np.zeros(3)

    @cached_property
    def _placed(self) -> list[tuple[Any, Any]]:
        """The bodies as the engine of the world needs them."""
        transform = self._world.engine.transform
        return [(shape.geometry, transform(T_palm_shape)) for shape, T_palm_shape in self._bodies]

    def reach(self, u: FloatArray) -> float:
        """Return how far the bodies reach along the unit vector `u` (3,) [m]."""
        plane, beyond = self._plane(u), half_space().geometry
        return PLANE_DISTANCE - min(
            self._world.engine.distance(geometry, T, beyond, plane) for geometry, T in self._placed
        )

    def farthest(self, u: FloatArray) -> FloatArray:
        """Return the point (3,) [m] of the bodies that is farthest along the unit vector `u`."""
        plane, beyond = self._plane(u), half_space().geometry
        found = [self._world.engine.witness(*placed, beyond, plane) for placed in self._placed]
        return np.asarray(min(found, key=lambda each: each.distance).points[0])

    def nearest(self, point: FloatArray) -> Witness:
        """Return the nearest point of the bodies to ``point`` (3,) [m], which comes first."""
        ball = sphere(PROBE_RADIUS).geometry
        at = self._world.engine.transform(se3.from_rotation_translation(np.eye(3), point))
        found = [self._world.engine.witness(ball, at, *placed) for placed in self._placed]
        return min(found, key=lambda each: each.distance)

    def T_palm_group(self, group: int) -> FloatArray:
        """Return the pose (4, 4) of a group of the linkage."""
        return np.asarray(self._T_palm_base @ self._T[group])

    def _plane(self, u: FloatArray) -> Any:
        return self._world.engine.transform(
            se3.from_rotation_translation(_with_z(-u), PLANE_DISTANCE * u)
        )


def _with_z(u: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose third column is the unit vector ``u`` (3,)."""
    x = np.eye(3)[int(np.abs(u).argmin())]
    x = x - (x @ u) * u
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(u, x), u))
