"""How fast the tool point can go in each direction, drawn as an ellipsoid round it."""

from __future__ import annotations

import numpy as np
import viser

from katana450.arm.control.state import State
from katana450.arm.robot.mounted_arm import MountedArm
from katana450.maths.geometry import so3
from katana450.maths.kinematics.forward import forward
from katana450.maths.kinematics.velocity import velocity_ellipsoid

SCALE = 0.2
"""[rad] Drawn is how far the tool point gets while the joints turn by this much together."""

MIN_RADIUS = 1e-3
"""[m] Flat in a singularity, but still to be seen."""

COLOUR = (124, 77, 219)


class EllipsoidNode:
    """Hidden until a person asks for it."""

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
        """Show it for ``state``, or hide it."""
        self._node.visible = visible
        self.follow(state)

    def follow(self, state: State) -> None:
        """Go where the tool of ``state`` is, if shown."""
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
