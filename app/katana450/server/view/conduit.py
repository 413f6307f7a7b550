"""The conduit in the scene: rings along its curves, drawn by the browser from one ring's shape."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from katana450.arm.robot.conduit import ConduitStretch
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.scene import ArmNodes, Colour
from katana450.server.viser_bridge.posing import arrange

Floats = npt.NDArray[np.float32]

RUBBER: Colour = (4, 4, 5)
"""Of light, not of sRGB as elsewhere: so viser takes the colours of instances."""

PITCH = 4.2e-3
"""[m] From rib to rib."""

PROFILE = ((-0.62, 0.84), (-0.3, 0.92), (0.0, 1.0), (0.3, 0.92), (0.62, 0.84))
"""(along, out) of a ring, of the pitch and of the radius; neighbours overlap, so no gap opens in a
bend."""

SIDES = 14

ANGLE_WORTH_SENDING = 2e-3
"""[rad] Moves a rib by less than a third of a millimetre."""


class _Hung:
    """A stretch as it is drawn: the poses of its rings for a row of angles, and the one shown."""

    def __init__(self, server: viser.ViserServer, stretch: ConduitStretch, path: str) -> None:
        """``path``: of its node in the scene."""
        self.stretch = stretch
        self._poses = poses(stretch, round(stretch.length / PITCH))
        self._steps = np.diff(self._poses, axis=0)
        self._shown = 0.0
        rings = self._at(0.0)
        self._node = server.scene.add_batched_meshes_simple(
            path,
            *ring(stretch.radius),
            rings[:, :4],
            rings[:, 4:],
            batched_colors=RUBBER,
            lod="off",
        )

    def bend(self, angle: float) -> None:
        """Bend it to the ``angle`` [rad] of its joint."""
        if abs(angle - self._shown) > ANGLE_WORTH_SENDING:
            self._shown = angle
            rings = self._at(angle)
            arrange(self._node, rings[:, :4], rings[:, 4:])

    def _at(self, angle: float) -> Floats:
        """(count, 7) the rings' poses in between those worked out."""
        low, fraction = self.stretch.between(angle)
        rings: Floats = self._poses[low] + np.float32(fraction) * self._steps[low]
        return rings


class Conduits:
    """Hang below the links they start from; sent anew only when the joint between has moved."""

    def __init__(self, server: viser.ViserServer, arm: MountedArm, nodes: ArmNodes) -> None:
        self._hung = [
            _Hung(server, stretch, f"{nodes.path[stretch.start.link]}/conduit{number}")
            for number, stretch in enumerate(arm.stretches)
        ]

    def move(self, angles: Mapping[str, float]) -> None:
        """Bend it to the joint ``angles`` [rad]."""
        for hung in self._hung:
            hung.bend(angles[hung.stretch.hinge.joint])


def poses(stretch: ConduitStretch, count: int) -> Floats:
    """(A, count, 7) wxyz and position [m] of the rings for each of its angles.

    From angle to angle every ring turns the shortest way, so that a pose in between is to be had
    by leading all seven numbers linearly: its quaternion is then of length 1 to a thousandth.
    """
    points, tangents = stretch.courses(stretch.angles, count)
    wxyz = np.empty((*tangents.shape[:2], 4))
    wxyz[0] = _shortest_turn(np.broadcast_to((1.0, 0.0, 0.0), tangents[0].shape), tangents[0])
    for before in range(len(tangents) - 1):
        turned = _shortest_turn(tangents[before], tangents[before + 1])
        wxyz[before + 1] = so3.quaternion_product(turned, wxyz[before])
    return np.concatenate((wxyz, points), axis=2, dtype=np.float32)


def _shortest_turn(a: FloatArray, b: FloatArray) -> FloatArray:
    """Wxyz (n, 4) of the turns of the unit vectors ``a`` onto ``b``, both (n, 3)."""
    wxyz = np.column_stack((1.0 + (a * b).sum(axis=1), np.cross(a, b)))
    # Straight back, as from x only: of the half turns that will do, the one about z.
    wxyz[wxyz[:, 0] < BACKWARD] = (0.0, 0.0, 0.0, 1.0)
    return np.asarray(wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True))


BACKWARD = 1e-9


def ring(radius: float) -> tuple[FloatArray, npt.NDArray[Any]]:
    """Vertices (n, 3) [m] and faces (m, 3) of a rib about the x axis."""
    turn = np.arange(SIDES) * (math.tau / SIDES)
    circle = np.stack((np.zeros(SIDES), np.cos(turn), np.sin(turn)), axis=1)
    rows = [np.array([along * PITCH, 0.0, 0.0]) + out * radius * circle for along, out in PROFILE]
    first = np.arange(SIDES)
    second = (first + 1) % SIDES
    faces = []
    for row in range(len(PROFILE) - 1):
        a, b = row * SIDES, (row + 1) * SIDES
        faces.append(np.stack((a + first, a + second, b + second), axis=1))
        faces.append(np.stack((a + first, b + second, b + first), axis=1))
    return np.concatenate(rows), np.concatenate(faces)
