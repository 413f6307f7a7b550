"""A warning colour on links and props that are near a contact."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import viser

from katana450.arm.control.state import State
from katana450.arm.robot.props import Props
from katana450.arm.robot.robot import Robot
from katana450.arm.robot.visual import Visual
from katana450.maths.geometry.arrays import frozen
from katana450.server.view.scene import surface


class Tint:
    """Coats parts near a contact: links with their collision shapes, props with their own."""

    COLOUR = (224, 49, 49)
    OPACITY = 0.55

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        path: Mapping[str, str],
        props: Props | None = None,
    ) -> None:
        """Prepare the coats; ``path``: the scene node of each link. A prop's node is its name."""
        self._server = server
        self._shapes = {link.name: (path[link.name], robot.bodies(link)) for link in robot.links}
        for name in () if props is None else ("table", "cup", "basin"):
            mesh = getattr(props, name).mesh
            self._shapes[name] = (
                f"/{name}",
                (Visual(frozen(np.eye(4)), frozen(np.ones(3)), mesh),),
            )
        # Made on first use: most runs never come near a contact.
        self._coats: dict[str, list[viser.MeshHandle]] = {}
        self._coated: frozenset[str] = frozenset()

    def follow(self, state: State) -> None:
        """Coat the parts that are near a contact in ``state``, and no others."""
        parts = state.near
        for part in self._coated ^ parts:
            for coat in self._coat(part):
                coat.visible = part in parts
        self._coated = parts

    def _coat(self, part: str) -> list[viser.MeshHandle]:
        if part not in self._coats:
            path, shapes = self._shapes.get(part, ("", ()))
            self._coats[part] = [
                self._server.scene.add_mesh_simple(
                    f"{path}/contact{number}",
                    *surface(shape),
                    color=self.COLOUR,
                    opacity=self.OPACITY,
                    cast_shadow=False,
                    receive_shadow=False,
                )
                for number, shape in enumerate(shapes)
            ]
        return self._coats[part]
