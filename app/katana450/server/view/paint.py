"""Links that somebody hid, or painted in one colour."""

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
    """What a link is shown as once it is painted.

    colour: of a paint that nobody has mixed.
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
    """The nodes of a robot's links, by name: its shapes as they are made, and what they are."""

    @property
    def shapes(self) -> Mapping[str, Sequence[Any]]: ...

    @property
    def path(self) -> Mapping[str, str]: ...

    def surfaces(self, link: str) -> Sequence[VisualMesh]: ...


class PaintNodes:
    """Follows the looks of a state; all that was never painted costs nothing."""

    def __init__(self, server: viser.ViserServer, links: LinkPaint) -> None:
        self._server = server
        self._links = links
        self._coats: dict[str, _PaintCoat] = {}
        self._seen = Appearance()

    def follow(self, state: State) -> None:
        """Show every link as ``state`` says."""
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
