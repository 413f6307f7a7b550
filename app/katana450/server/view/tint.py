"""The parts that are about to touch, links and objects alike, coated in a warning colour."""

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
    """Coats links in the shapes that stand for them where contacts are looked for, objects in their
    own.
    """

    COLOUR = (224, 49, 49)
    OPACITY = 0.55

    def __init__(
        self,
        server: viser.ViserServer,
        robot: Robot,
        path: Mapping[str, str],
        props: Props,
    ) -> None:
        """``path``: the scene node of each link; an object's is its name."""
        self._server = server
        self._shapes = {link.name: (path[link.name], link.collisions) for link in robot.links} | {
            name: (f"/{name}", (Visual(frozen(np.eye(4)), frozen(np.ones(3)), mesh),))
            for name, mesh in (
                ("table", props.table.mesh),
                ("cup", props.cup.mesh),
                ("basin", props.basin.mesh),
            )
        }
        # Made when they are first needed: most runs never touch anything.
        self._coats: dict[str, list[viser.MeshHandle]] = {}
        self._coated: frozenset[str] = frozenset()

    def follow(self, state: State) -> None:
        """Coat the parts that ``state`` says are near a contact, and no others."""
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
