"""The conduit in the scene: rings along its curves, drawn as instances of one mesh."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from katana450.arm.control.state.state import State
from katana450.arm.robot.robot import Robot
from katana450.extensions.conduit.stretches import ConduitStretch, stretches_of
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.layer import LayerContext, ViewLayer
from katana450.server.view.scene import Colour
from katana450.server.viser_bridge.posing import arrange

Floats = npt.NDArray[np.float32]

RUBBER: Colour = (4, 4, 5)
"""Linear colour, not sRGB as elsewhere: viser expects linear colours for instances."""

PITCH = 4.2e-3
"""Distance [m] between two ribs."""

PROFILE = ((-0.62, 0.84), (-0.3, 0.92), (0.0, 1.0), (0.3, 0.92), (0.62, 0.84))
"""Cross section of a ring as (along, out), fractions of pitch and radius.

Neighbouring rings overlap, so that no gap opens in a bend.
"""

SIDES = 14
"""Corners of a ring."""

ANGLE_WORTH_SENDING = 2e-3
"""Smallest change [rad] that is sent. It moves a rib by less than a third of a millimetre."""


class _StretchNode:
    """One stretch in the scene."""

    def __init__(self, server: viser.ViserServer, stretch: ConduitStretch, path: str) -> None:
        """Add the rings to the scene as the node ``path``."""
        self.stretch = stretch
        self._shown = 0.0
        rings = poses(stretch, 0.0)
        self._node = server.scene.add_batched_meshes_simple(
            path,
            *ring(stretch.radius),
            rings[:, :4],
            rings[:, 4:],
            batched_colors=RUBBER,
            lod="off",
        )

    def bend(self, angle: float) -> None:
        """Show the stretch at the ``angle`` [rad] of its joint."""
        if abs(angle - self._shown) > ANGLE_WORTH_SENDING:
            self._shown = angle
            rings = poses(self.stretch, angle)
            arrange(self._node, rings[:, :4], rings[:, 4:])


class Conduits:
    """All stretches, each a child of the link it starts from. Only changed stretches are sent."""

    def __init__(self, server: viser.ViserServer, robot: Robot, path: Mapping[str, str]) -> None:
        """Add the rings of ``robot``; ``path``: the scene node of each link.

        Raises RobotDescriptionError for an invalid description of its conduit.
        """
        self._stretches = [
            _StretchNode(server, stretch, f"{path[stretch.start.link]}/conduit{number}")
            for number, stretch in enumerate(stretches_of(robot))
        ]

    def move(self, angles: Mapping[str, float]) -> None:
        """Show the conduit at the joint ``angles`` [rad], given by joint name."""
        for node in self._stretches:
            node.bend(angles[node.stretch.joint.name])


class ConduitLayer(ViewLayer):
    """The conduit as a layer of the scene, without controls."""

    def attach(self, context: LayerContext) -> None:
        """Add the rings. Raises RobotDescriptionError."""
        self._robot = context.robot
        self._conduits = Conduits(context.server, context.robot, context.arm.path)

    def follow(self, state: State) -> None:
        """Bend the conduit as the joints of ``state`` do."""
        self._conduits.move(self._robot.joint_values(state.q, state.gripper))


def poses(stretch: ConduitStretch, angle: float) -> Floats:
    """Return the poses (n, 7) of the rings at the ``angle`` [rad]: wxyz and position [m].

    A ring looks the same however it is turned about the conduit.
    """
    points, tangents = stretch.course(angle, round(stretch.length / PITCH))
    # The shortest turn of the x axis to each tangent; to the opposite one half a turn about z.
    wxyz = np.zeros((len(tangents), 4))
    wxyz[:, 0], wxyz[:, 2:] = 1.0 + tangents[:, 0], tangents[:, :0:-1] * (-1.0, 1.0)
    wxyz[wxyz[:, 0] < BACKWARD] = (0.0, 0.0, 0.0, 1.0)
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    return np.concatenate((wxyz, points), axis=1, dtype=np.float32)


BACKWARD = 1e-9
"""Bound of 1 + cos(angle) below which two unit vectors count as opposite."""


def ring(radius: float) -> tuple[FloatArray, npt.NDArray[Any]]:
    """Return vertices (n, 3) [m] and faces (m, 3) of a rib about the x axis."""
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
