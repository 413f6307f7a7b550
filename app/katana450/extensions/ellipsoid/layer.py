"""The velocity ellipsoid, which shows how fast the tool point can move in each direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import viser

from katana450.arm.control.state import State
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray, frozen
from katana450.maths.kinematics.chain import Chain
from katana450.maths.kinematics.forward import forward, jacobian_body
from katana450.server.view.layer import LayerContext, ViewLayer


@dataclass(frozen=True, eq=False)
class VelocityEllipsoid:
    """Velocities of the tool point with joint rates of unit norm.

    Attributes:
        axes: principal directions in {S} as columns (3, 3), right-handed.
        radii: radii (3,) [m/rad] in falling order. Where a radius is 0 the arm cannot move the tool
            point in that direction.
    """

    axes: FloatArray
    radii: FloatArray


def velocity_ellipsoid(chain: Chain, q: npt.ArrayLike) -> VelocityEllipsoid:
    """Return the ellipsoid of the tool point's translational Jacobian at `q` (n,) [rad]."""
    R = forward(chain, q)[:3, :3]
    axes, radii, _ = np.linalg.svd(R @ jacobian_body(chain, q)[3:])
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return VelocityEllipsoid(frozen(axes), frozen(radii))


SCALE = 0.2
"""Joint motion [rad] (norm) to which the drawn displacement of the tool point belongs."""

MIN_RADIUS = 1e-3
"""Minimum radius [m]: the ellipsoid is flat in a singularity, but stays visible."""

COLOUR = (124, 77, 219)


class EllipsoidLayer(ViewLayer):
    """The ellipsoid as a layer of the scene, hidden until a person shows it."""

    def attach(self, context: LayerContext) -> None:
        """Add the hidden node."""
        self._arm = context.robot.require_arm()
        self._state: State | None = None
        self._node = context.server.scene.add_icosphere(
            "/velocity",
            radius=1.0,
            color=COLOUR,
            opacity=0.3,
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def add_controls(self, gui: viser.GuiApi) -> None:
        """Add the checkbox that shows the ellipsoid."""
        box = gui.add_checkbox(
            "Velocity ellipsoid",
            initial_value=False,
            hint="Possible speed of the tool point in each direction; flat at a singularity",
        )

        @box.on_update
        def _(_: viser.GuiEvent[Any]) -> None:
            self._node.visible = box.value
            if self._state is not None:
                self.follow(self._state)

    def follow(self, state: State) -> None:
        """Draw the ellipsoid for ``state`` if it is shown."""
        self._state = state
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
