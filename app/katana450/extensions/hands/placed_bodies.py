"""Bodies of a hand at one place of its fingers, in the frame of the palm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from katana450.maths.collision.contact import Witness
from katana450.maths.collision.engine import Placement, distance, witness
from katana450.maths.collision.shape import CollisionShape, half_space, placement, sphere
from katana450.maths.collision.world import CollisionWorld, Part
from katana450.maths.geometry import se3
from katana450.maths.geometry.arrays import FloatArray

PLANE_DISTANCE: Final = 10.0
"""[m] Distance of the planes from which the extent of bodies is measured."""

HALF_SPACE: Final = half_space()

PROBE: Final = sphere(1e-5)
"""The ball that stands for a point."""


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
        self._placed = placed
        middles = [T[:3, :3] @ shape.centre + T[:3, 3] for shape, T in placed]
        self.middle: FloatArray = np.mean(middles, axis=0) if middles else np.zeros(3)

    def reach(self, u: FloatArray) -> float:
        """Return how far the bodies reach along the unit vector `u` (3,) [m]."""
        placed, plane = self._with(HALF_SPACE, _plane(u)), len(self._placed)
        return PLANE_DISTANCE - min(distance(placed, body, plane) for body in range(plane))

    def farthest(self, u: FloatArray) -> FloatArray:
        """Return the point (3,) [m] of the bodies that is farthest along the unit vector `u`."""
        placed, plane = self._with(HALF_SPACE, _plane(u)), len(self._placed)
        contacts = [witness(placed, body, plane) for body in range(plane)]
        return np.asarray(min(contacts, key=lambda contact: contact.distance).points[0])

    def nearest(self, point: FloatArray) -> Witness:
        """Return the nearest point of the bodies to ``point`` (3,) [m], which comes first."""
        T = se3.from_rotation_translation(np.eye(3), point)
        placed, ball = self._with(PROBE, T), len(self._placed)
        contacts = [witness(placed, ball, body) for body in range(ball)]
        return min(contacts, key=lambda contact: contact.distance)

    def _with(self, shape: CollisionShape, T: FloatArray) -> Placement:
        """Return the geometries of the bodies, and then that of ``shape`` at ``T`` (4, 4) [m]."""
        return placement(*self._placed, (shape, T))

    def T_palm_group(self, group: int) -> FloatArray:
        """Return the pose (4, 4) of a group of the linkage."""
        return np.asarray(self._T_palm_base @ self._T[group])


def _plane(u: FloatArray) -> FloatArray:
    """Return the pose (4, 4) of a half-space that begins beyond the bodies along ``u`` (3,) [m]."""
    return se3.from_rotation_translation(_with_z(-u), PLANE_DISTANCE * u)


def _with_z(u: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose third column is the unit vector ``u`` (3,)."""
    x = np.eye(3)[int(np.abs(u).argmin())]
    x = x - (x @ u) * u
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(u, x), u))
