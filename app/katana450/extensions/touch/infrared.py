"""Simulated infrared sensors of the gripper: rays from the fingers and the palm to the objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from katana450.extensions.touch.gripper_sensors import MAX_DISTANCE
from katana450.extensions.touch.pad import SIDES
from katana450.extensions.touch.solid_body import SolidBody
from katana450.maths.geometry.arrays import FloatArray

# Place [m] and direction in the plane of a finger, with y as on the right finger. The places are
# read from the mesh of the finger: the middles of both inner faces, the outer face, and the tip.
RAYS: Mapping[str, tuple[tuple[float, float], tuple[float, float]]] = {
    "near_distance": ((32.9e-3, 28.0e-3), (0.572, -0.820)),
    "far_distance": ((74.5e-3, 35.3e-3), (0.420, -0.908)),
    "outer_distance": ((55.5e-3, 42.0e-3), (0.517, 0.856)),
    "tip_distance": ((84.3e-3, 44.0e-3), (0.910, 0.415)),
}
"""Rays of the sensors of a finger, by the ends of their names."""

PALM_RAY = ((78e-3, 0.0, 0.0), (1.0, 0.0, 0.0))
"""Place [m] and direction of the sensor in the palm, in the frame of the link that rolls. It is
between the fingers, where they leave the palm."""


class InfraredRays:
    """The rays of both fingers and of the palm."""

    def __init__(self, palm: int, fingers: Mapping[str, int]) -> None:
        """Prepare the rays.

        Args:
            palm: index of the group of the palm.
            fingers: index of the group of each finger, by the name of its link.
        """
        rays = {
            f"{name.split('_')[1]}_{end}": (
                fingers[name],
                (*_mirrored(at, side), 0.0),
                (*_mirrored(to, side), 0.0),
            )
            for name, side in SIDES.items()
            for end, (at, to) in RAYS.items()
        }
        rays["centre_distance"] = (palm, *PALM_RAY)
        self.names = tuple(rays)
        self._groups = np.array([group for group, _, _ in rays.values()])
        self._starts = np.array([at for _, at, _ in rays.values()])
        directions = np.array([to for _, _, to in rays.values()])
        self._directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def distances(
        self, poses: FloatArray, bodies: Sequence[tuple[SolidBody, FloatArray]]
    ) -> FloatArray:
        """Return the distance [m] along each ray to the nearest body or to the table.

        It is MAX_DISTANCE if there is nothing nearer.

        Args:
            poses: (m, 4, 4) poses of all groups in the base frame.
            bodies: bodies of the objects, with the poses (4, 4) of their middles in the base frame.
        """
        T = poses[self._groups]
        starts = np.einsum("nij,nj->ni", T[:, :3, :3], self._starts) + T[:, :3, 3]
        directions = np.einsum("nij,nj->ni", T[:, :3, :3], self._directions)
        down = -directions[:, 2]
        found = np.where(down > 0.0, starts[:, 2] / np.where(down > 0.0, down, 1.0), MAX_DISTANCE)
        for body, T_base_body in bodies:
            R, p = T_base_body[:3, :3], T_base_body[:3, 3]
            found = np.minimum(found, body.distances((starts - p) @ R, directions @ R))
        return np.clip(found, 0.0, MAX_DISTANCE)


def _mirrored(point: tuple[float, float], side: float) -> tuple[float, float]:
    return point[0], side * point[1]
