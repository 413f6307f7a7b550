"""Links that are hidden or painted in one colour."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import viser

from katana450.arm.control.state.appearance import Appearance, DisplayMode, LinkAppearance
from katana450.arm.control.state.state import State
from katana450.arm.robot.surfaces import main_colour
from katana450.server.view.scene import ArmNodes, Colour


@dataclass
class _PaintCoat:
    """The painted shapes of a link.

    Attributes:
        shapes: the nodes.
        colour: colour (sRGB, 0 to 1) if the appearance has none.
    """

    shapes: Sequence[viser.MeshHandle]
    colour: tuple[float, float, float]

    def show(self, look: LinkAppearance) -> None:
        for shape in self.shapes:
            shape.visible = look.choice is DisplayMode.PAINTED
            if shape.visible:
                shape.color = _of_255(look.colour or self.colour)
                shape.opacity = 1.0 - look.transparency if look.transparency > 0.0 else None


class PaintNodes:
    """Shows the appearance of links. Painted shapes are made when a link is first painted."""

    def __init__(self, server: viser.ViserServer, links: ArmNodes) -> None:
        self._server = server
        self._links = links
        self._coats: dict[str, _PaintCoat] = {}
        self._seen = Appearance()

    def follow(self, state: State) -> None:
        """Show every link with its appearance in ``state``."""
        looks = state.appearance
        if looks is self._seen or looks == self._seen:
            return
        for name in {name for appearance in (self._seen, looks) for name, _ in appearance.changed}:
            if name in self._links.shapes:
                self._show_link(name, looks.of(name))
        self._seen = looks

    def _show_link(self, name: str, look: LinkAppearance) -> None:
        for shape in self._links.shapes[name]:
            shape.visible = look.choice is DisplayMode.MADE
        if look.choice is DisplayMode.PAINTED and name not in self._coats:
            path, surfaces = self._links.path[name], self._links.links[name].shapes
            shapes = [
                self._server.scene.add_mesh_simple(
                    f"{path}/paint{number}",
                    surface.vertices.astype(np.float32),
                    surface.faces.astype(np.uint32),
                )
                for number, surface in enumerate(surfaces)
            ]
            self._coats[name] = _PaintCoat(shapes, main_colour(surfaces))
        if name in self._coats:
            self._coats[name].show(look)


def _of_255(colour: tuple[float, float, float]) -> Colour:
    """Return ``colour`` (0 to 1) as numbers from 0 to 255, as viser expects."""
    red, green, blue = (round(255.0 * part) for part in colour)
    return red, green, blue
