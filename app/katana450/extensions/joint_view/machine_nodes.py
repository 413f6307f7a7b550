"""Any robot in the scene: one frame per link, nested as the links are, that turns or slides."""

from __future__ import annotations

from collections.abc import Sequence

import viser

from katana450.arm.robot.robot import Robot
from katana450.arm.robot.surfaces import VisualMesh
from katana450.server.view.scene import FrameTree, add_shape


class MachineNodes(FrameTree):
    """The links of a robot and their shapes, as nodes of the scene.

    Attributes:
        shapes: nodes of each link's shapes in their original look, by link name.
    """

    def __init__(self, server: viser.ViserServer, robot: Robot) -> None:
        super().__init__(server, "/arm", robot)
        self._surfaces = {link.name: link.shapes for link in robot.links}
        self.shapes = {
            name: [
                add_shape(server, f"{self.path[name]}/shape{number}", shape, shape.material.colour)
                for number, shape in enumerate(shapes)
            ]
            for name, shapes in self._surfaces.items()
        }

    def surfaces(self, link: str) -> Sequence[VisualMesh]:
        """Return the surfaces of ``link``."""
        return self._surfaces[link]
