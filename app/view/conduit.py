"""The conduit in the scene: rings along its curves, drawn by the browser from one ring's shape."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from app.geometry.arrays import FloatArray
from app.robot.conduit import Stretch
from app.robot.model import RobotModel
from app.view.scene import ArmNodes, Colour

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


@dataclass
class _Hung:
    """A stretch as it is drawn: in how many rings, and for which angle [rad]."""

    stretch: Stretch
    count: int
    node: viser.BatchedMeshHandle
    angle: float = 0.0


class Conduits:
    """Hang below the links they start from; sent anew only when the joint between has moved."""

    def __init__(self, server: viser.ViserServer, model: RobotModel, arm: ArmNodes) -> None:
        self._hung: list[_Hung] = []
        for number, stretch in enumerate(model.stretches):
            count = round(stretch.length / PITCH)
            wxyzs, positions = _placed(stretch, 0.0, count)
            vertices, faces = ring(stretch.radius)
            node = server.scene.add_batched_meshes_simple(
                f"{arm.path[stretch.start.link]}/conduit{number}",
                vertices,
                faces,
                wxyzs,
                positions,
                batched_colors=RUBBER,
                lod="off",
            )
            self._hung.append(_Hung(stretch, count, node))

    def move(self, angles: Mapping[str, float]) -> None:
        """Bend it to the joint ``angles`` [rad]."""
        for hung in self._hung:
            angle = angles[hung.stretch.hinge.joint]
            if abs(angle - hung.angle) > ANGLE_WORTH_SENDING:
                hung.angle = angle
                wxyzs, positions = _placed(hung.stretch, angle, hung.count)
                hung.node.batched_wxyzs, hung.node.batched_positions = wxyzs, positions


def _placed(
    stretch: Stretch, angle: float, count: int
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    """(count, 4) wxyz and (count, 3) positions of the rings: the shortest turn of x onto each."""
    points, t = stretch.course(angle, count)
    wxyz = np.stack((1.0 + t[:, 0], np.zeros(count), -t[:, 2], t[:, 1]), axis=1)
    # Straight back along x every half turn across it will do.
    wxyz[wxyz[:, 0] < BACKWARD] = (0.0, 0.0, 0.0, 1.0)
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    return wxyz.astype(np.float32), points.astype(np.float32)


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
