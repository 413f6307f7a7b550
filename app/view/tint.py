"""The parts that are about to touch, coated in a warning colour."""

from __future__ import annotations

from collections.abc import Mapping

import viser

from app.control.state import Reason, State
from app.robot.model import RobotModel
from app.view.scene import surface


class Tint:
    """Coats links in the shapes that stand for them where contacts are looked for."""

    COLOUR = (224, 49, 49)
    OPACITY = 0.55

    def __init__(
        self, server: viser.ViserServer, model: RobotModel, path: Mapping[str, str]
    ) -> None:
        """``path``: the scene node of each link."""
        self._server = server
        self._path = path
        self._shapes = {body.name: body.collisions for body in model.bodies}
        # Made when they are first needed: most runs never touch anything.
        self._coats: dict[str, list[viser.MeshHandle]] = {}
        self._coated: frozenset[str] = frozenset()

    def follow(self, state: State) -> None:
        """Coat the links that ``state`` says are near a contact, and no others."""
        parts = frozenset(
            part
            for finding in state.findings
            if finding.reason is Reason.CONTACT
            for part in finding.parts or ()
        )
        for part in self._coated ^ parts:
            for coat in self._coat(part):
                coat.visible = part in parts
        self._coated = parts

    def _coat(self, part: str) -> list[viser.MeshHandle]:
        if part not in self._coats:
            self._coats[part] = [
                self._server.scene.add_mesh_simple(
                    f"{self._path[part]}/contact{number}",
                    *surface(shape),
                    color=self.COLOUR,
                    opacity=self.OPACITY,
                    cast_shadow=False,
                    receive_shadow=False,
                )
                for number, shape in enumerate(self._shapes.get(part, ()))
            ]
        return self._coats[part]
