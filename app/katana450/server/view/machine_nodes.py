"""Any robot in the scene: one frame per link, nested as the links are, that turns or slides."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import viser

from katana450.arm.robot.link import Joint
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import VisualMesh
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.scene import add_shape, node_name
from katana450.server.viser_bridge.posing import place, turn

WORTH_SENDING = 1e-7
"""Smallest change of a joint [rad, m] that is sent."""


class MachineNodes:
    """The links of a robot and their shapes, as nodes of the scene.

    Attributes:
        path: path of each link's node, by link name.
        shapes: nodes of each link's shapes in their original look, by link name.
    """

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        self.path: dict[str, str] = {}
        self.shapes: dict[str, list[viser.MeshHandle]] = {}
        self._jointed: list[tuple[Joint, FloatArray, viser.FrameHandle]] = []
        self._sent: dict[str, float] = {}
        self._surfaces = {link.name: link.shapes for link in robot.links}
        root = server.scene.add_frame("/arm", show_axes=False).name
        for link in robot.links:
            above = root if link.parent is None else self.path[link.parent]
            path = self.path[link.name] = f"{above}/{node_name(link.name)}"
            T = link.T_parent_link
            frame = server.scene.add_frame(
                path, show_axes=False, wxyz=so3.to_quaternion(T[:3, :3]), position=T[:3, 3]
            )
            if link.joint is not None:
                self._jointed.append((link.joint, T, frame))
            self.shapes[link.name] = [
                add_shape(server, f"{path}/shape{each}", shape, shape.material.colour)
                for each, shape in enumerate(link.shapes)
            ]

    def surfaces(self, link: str) -> Sequence[VisualMesh]:
        """Return the surfaces of ``link``."""
        return self._surfaces[link]

    def move(self, values: Mapping[str, float]) -> None:
        """Place the links for the joint ``values`` [rad, m]. Only changes are sent."""
        for joint, T_parent_link, frame in self._jointed:
            value = values[joint.name]
            if abs(value - self._sent.get(joint.name, np.inf)) <= WORTH_SENDING:
                continue
            self._sent[joint.name] = value
            T = T_parent_link @ joint.motion(value)
            if joint.slides:
                x, y, z = T[:3, 3].tolist()
                place(frame, (x, y, z))
            else:
                w, i, j, k = so3.to_quaternion(T[:3, :3]).tolist()
                turn(frame, (w, i, j, k))
