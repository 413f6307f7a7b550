"""Links that are hidden or painted in one colour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import viser

from katana450.arm.control.appearance import Appearance, DisplayMode, LinkAppearance
from katana450.arm.control.state import State
from katana450.arm.robot.surfaces import VisualMesh, main_colour
from katana450.server.view.scene import add_shape, of_255


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
                shape.color = of_255(look.colour or self.colour)
                shape.opacity = 1.0 - look.transparency if look.transparency > 0.0 else None


class LinkPaint(Protocol):
    """The nodes of a robot's links, such as `ArmNodes` or `MachineNodes`."""

    @property
    def shapes(self) -> Mapping[str, Sequence[Any]]:
        """Nodes of each link's shapes in their original look, by link name."""

    @property
    def path(self) -> Mapping[str, str]:
        """Path of each link's node, by link name."""

    def surfaces(self, link: str) -> Sequence[VisualMesh]:
        """Return the surfaces of ``link``, one per material."""


class PaintNodes:
    """Shows the appearance of links. Painted shapes are made when a link is first painted."""

    def __init__(self, server: viser.ViserServer, links: LinkPaint) -> None:
        self._server = server
        self._links = links
        self._coats: dict[str, _PaintCoat] = {}
        self._seen = Appearance()

    def follow(self, state: State) -> None:
        """Show every link with its appearance in ``state``."""
        looks = state.appearance
        if looks is self._seen or looks == self._seen:
            return
        for name in {name for each in (self._seen, looks) for name, _ in each.changed}:
            if name in self._links.shapes:
                self._show_link(name, looks.of(name))
        self._seen = looks

    def _show_link(self, name: str, look: LinkAppearance) -> None:
        for made in self._links.shapes[name]:
            made.visible = look.choice is DisplayMode.MADE
        if look.choice is DisplayMode.PAINTED and name not in self._coats:
            surfaces = self._links.surfaces(name)
            colour, path = main_colour(surfaces), self._links.path[name]
            shapes = [
                add_shape(self._server, f"{path}/paint{number}", surface, colour)
                for number, surface in enumerate(surfaces)
            ]
            self._coats[name] = _PaintCoat(shapes, colour)
        if name in self._coats:
            self._coats[name].show(look)
