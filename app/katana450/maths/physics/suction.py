"""A suction cup: the force of its pressure, and how its rim stands on a face."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from katana450.maths.geometry.arrays import FloatArray

PRESSURE = 5e4
"""[Pa] Difference of pressure in a suction cup that holds, half of an atmosphere. Assumed."""

SEAL_GAP = 1e-3
"""[m] Distance from a face up to which a cup seals, because its lip yields. Assumed."""

PROBE_DEPTH = 5e-3
"""[m] Distance behind the rim from which the distance of a face is measured."""

PROBES = 8
"""Number of places round the rim at which it is measured."""


class Seal(NamedTuple):
    """The rim of a suction cup on an object.

    Attributes:
        item: name of the object.
        gap: greatest distance of the rim and its middle from the face of the object [m].
    """

    item: str
    gap: float

    @property
    def is_tight(self) -> bool:
        """True if the cup holds the object: the lip yields by as much as the gap."""
        return self.gap <= SEAL_GAP


class SuctionCup(NamedTuple):
    """A cup that holds a flat face by the lower pressure in it.

    Attributes:
        palm: the rigid group of the cup.
        grasp_point: the middle (3,) of its rim in the frame of that group [m].
        axis: the direction (3,) out of the cup there.
        radius: of the rim [m].
    """

    palm: int
    grasp_point: FloatArray
    axis: FloatArray
    radius: float

    @property
    def force(self) -> float:
        """The force of the pressure, with which it holds at most [N]."""
        return PRESSURE * math.pi * self.radius**2

    def probes(self) -> FloatArray:
        """Return points (p, 3) round the rim, and its middle, in the frame of the group [m]."""
        side = np.eye(3)[int(np.abs(self.axis).argmin())]
        one = np.cross(self.axis, side)
        one /= np.linalg.norm(one)
        angles = 2.0 * np.pi * np.arange(PROBES) / PROBES
        circle = np.outer(np.cos(angles), one) + np.outer(np.sin(angles), np.cross(self.axis, one))
        return np.asarray(self.grasp_point + self.radius * np.vstack((circle, np.zeros(3))))


def pull(data: Any, cup: SuctionCup, group: int, body: int) -> None:
    """Let the pressure push a body to the rim of ``cup``.

    data: the engine's. group, body: numbers of the bodies of the cup and of what it holds.
    """
    force = -cup.force * (data.xmat[group].reshape(3, 3) @ cup.axis)
    data.xfrc_applied[body, :3] = force
    data.xfrc_applied[body, 3:] = np.cross(data.xpos[group] - data.xipos[body], force)


def gap_of(compiled: Any, data: Any, cup: SuctionCup, group: int) -> tuple[set[int], float]:
    """Return the geometries before the rim of ``cup``, and their greatest distance from it [m].

    compiled, data: the engine's. group: number of the body of the cup. A number -1 stands for
    nothing before a part of the rim.
    """
    import mujoco

    R, geom = data.xmat[group].reshape(3, 3), np.zeros(1, dtype=np.int32)
    axis, gap, geoms = R @ cup.axis, 0.0, set[int]()
    for probe in cup.probes():
        start = data.xpos[group] + R @ (probe - cup.grasp_point) - PROBE_DEPTH * axis
        distance = mujoco.mj_ray(compiled, data, start, axis, None, True, group, geom)
        geoms.add(int(geom[0]))
        gap = max(gap, abs(distance - PROBE_DEPTH))
    return geoms, gap
