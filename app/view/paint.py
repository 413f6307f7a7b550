"""Links and things that somebody hid, or painted in one colour."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import trimesh
import viser

from app.control.looks import AS_MADE, Choice, Look, Looks
from app.control.state import State
from app.control.things import Surroundings, Thing
from app.exchange.mechanism import PLAIN, Shape, main_colour
from app.geometry import so3
from app.view.posing import place, turn
from app.view.scene import add_shape, of_255
from app.view.things import ThingNodes


@dataclass
class _Coat:
    """What a part is shown as once it is painted.

    colour: of a paint that nobody has mixed. node: of a thing, what carries the shape.
    """

    shapes: Sequence[viser.MeshHandle]
    colour: tuple[float, float, float]
    node: Any = None

    def show(self, look: Look) -> None:
        for shape in self.shapes:
            shape.visible = look.choice is Choice.PAINTED
            if shape.visible:
                shape.color = of_255(look.colour or self.colour)
                shape.opacity = 1.0 - look.transparency if look.transparency > 0.0 else None


class Links(Protocol):
    """The nodes of a robot's links, by name: its shapes as they are made, and what they are."""

    @property
    def shapes(self) -> Mapping[str, Sequence[Any]]: ...

    @property
    def path(self) -> Mapping[str, str]: ...

    def surfaces(self, link: str) -> Sequence[Shape]: ...


class PaintNodes:
    """Follows the looks of a state; all that was never painted costs nothing."""

    def __init__(
        self,
        server: viser.ViserServer,
        links: Links,
        things: ThingNodes | None = None,
        surroundings: Surroundings | None = None,
    ) -> None:
        """``things``, ``surroundings``: what stands around and where; None where nothing does."""
        self._server = server
        self._links = links
        self._things = things
        self._surroundings = surroundings
        self._coats: dict[str, _Coat] = {}
        self._seen = Looks()
        self._around: tuple[Thing, ...] = ()

    def follow(self, state: State) -> None:
        """Show every part as ``state`` says; to be called after the things are followed."""
        looks, things = state.looks, {thing.name: thing for thing in state.things}
        fresh = state.things is not self._around
        if looks != self._seen or (fresh and looks.changed):
            names = {name for each in (self._seen, looks) for name, _ in each.changed}
            for name in names:
                if name in self._links.shapes:
                    self._show_link(name, looks.of(name))
                elif name in things:
                    self._show_thing(name, looks.of(name))
                elif name in self._coats:
                    self._coats[name].show(AS_MADE)
        for name, _ in looks.changed:
            if name in self._coats and name in things and (fresh or things[name].held):
                self._pose(things[name], state)
        self._seen, self._around = looks, state.things

    def _show_link(self, name: str, look: Look) -> None:
        for made in self._links.shapes[name]:
            made.visible = look.choice is Choice.MADE
        if look.choice is Choice.PAINTED and name not in self._coats:
            surfaces = self._links.surfaces(name)
            colour, path = main_colour(surfaces), self._links.path[name]
            shapes = [
                add_shape(self._server, f"{path}/paint{number}", surface, colour)
                for number, surface in enumerate(surfaces)
            ]
            self._coats[name] = _Coat(shapes, colour)
        if name in self._coats:
            self._coats[name].show(look)

    def _show_thing(self, name: str, look: Look) -> None:
        assert self._things is not None
        node = self._things.node(name)
        node.visible = look.choice is Choice.MADE
        if look.choice is Choice.PAINTED and name not in self._coats:
            path = f"/paint/{len(self._coats)}"
            made = self._server.scene.add_frame(path, show_axes=False)
            mesh = trimesh.load_scene(io.BytesIO(node.glb_data), file_type="glb").to_mesh()
            shape = self._server.scene.add_mesh_simple(
                f"{path}/shape", mesh.vertices, np.asarray(mesh.faces)
            )
            self._coats[name] = _Coat([shape], PLAIN, made)
        if name in self._coats:
            self._coats[name].show(look)

    def _pose(self, thing: Thing, state: State) -> None:
        assert self._surroundings is not None
        T = self._surroundings.pose(thing, np.append(state.q, state.gripper))
        px, py, pz = T[:3, 3].tolist()
        w, i, j, k = so3.to_quaternion(T[:3, :3]).tolist()
        place(self._coats[thing.name].node, (px, py, pz))
        turn(self._coats[thing.name].node, (w, i, j, k))
