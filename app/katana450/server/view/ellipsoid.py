"""The velocity ellipsoid, which shows how fast the tool point can move in each direction."""

from __future__ import annotations

import numpy as np
import viser

from katana450.arm.control.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry import so3
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import velocity_ellipsoid

SCALE = 0.2
"""Joint motion [rad] (norm) to which the drawn displacement of the tool point belongs."""

MIN_RADIUS = 1e-3
"""Minimum radius [m]: the ellipsoid is flat in a singularity, but stays visible."""

COLOUR = (124, 77, 219)


class EllipsoidNode:
    """The ellipsoid in the scene, hidden until a person shows it."""

    def __init__(self, server: viser.ViserServer, arm: MountedArm) -> None:
        self._arm = arm
        self._node = server.scene.add_icosphere(
            "/velocity",
            radius=1.0,
            color=COLOUR,
            opacity=0.3,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def show(self, visible: bool, state: State) -> None:
        """Show the ellipsoid for ``state``, or hide it."""
        self._node.visible = visible
        self.follow(state)

    def follow(self, state: State) -> None:
        """Draw the ellipsoid for ``state`` if it is shown."""
        if not self._node.visible:
            return
        chain = self._arm.chain_to(state.tool)
        ellipsoid = velocity_ellipsoid(chain, state.q)
        T_base_shoulder = self._arm.T_base_shoulder
        T_base_tool = T_base_shoulder @ forward(chain, state.q)
        self._node.position = T_base_tool[:3, 3]
        self._node.wxyz = so3.to_quaternion(T_base_shoulder[:3, :3] @ ellipsoid.axes)
        x, y, z = np.maximum(SCALE * ellipsoid.radii, MIN_RADIUS).tolist()
        self._node.scale = (x, y, z)
