"""Links and things that somebody hid, or painted in one colour."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
import viser

from app.control.looks import AS_MADE, Choice, Look, Looks
from app.control.state import State
from app.control.things import Surroundings, Thing
from app.exchange.mechanism import PLAIN, main_colour
from app.exchange.urdf_mechanism import shapes_of
from app.geometry import so3
from app.robot.model import RobotModel
from app.view.posing import place, turn
from app.view.scene import ArmNodes, Colour
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
                shape.color = _of_255(look.colour or self.colour)
                shape.opacity = 1.0 - look.transparency if look.transparency > 0.0 else None


class PaintNodes:
    """Follows the looks of a state; all that was never painted costs nothing."""

    def __init__(
        self,
        server: viser.ViserServer,
        model: RobotModel,
        arm: ArmNodes,
        things: ThingNodes,
        surroundings: Surroundings,
    ) -> None:
        self._server = server
        self._arm = arm
        self._things = things
        self._surroundings = surroundings
        self._bodies = {body.name: body for body in model.bodies}
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
                if name in self._bodies:
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
        for shape in self._arm.shapes[name]:
            shape.visible = look.choice is Choice.MADE
        if look.choice is Choice.PAINTED and name not in self._coats:
            path, visuals = self._arm.path[name], self._bodies[name].visuals
            self._coats[name] = _Coat(
                [
                    self._mesh(f"{path}/paint{number}", visual.mesh)
                    for number, visual in enumerate(visuals)
                ],
                main_colour([shape for visual in visuals for shape in shapes_of(visual)]),
            )
        if name in self._coats:
            self._coats[name].show(look)

    def _show_thing(self, name: str, look: Look) -> None:
        node = self._things.node(name)
        node.visible = look.choice is Choice.MADE
        if look.choice is Choice.PAINTED and name not in self._coats:
            path = f"/paint/{len(self._coats)}"
            made = self._server.scene.add_frame(path, show_axes=False)
            scene = trimesh.load_scene(io.BytesIO(node.glb_data), file_type="glb")
            self._coats[name] = _Coat([self._mesh(f"{path}/shape", scene.to_mesh())], PLAIN, made)
        if name in self._coats:
            self._coats[name].show(look)

    def _pose(self, thing: Thing, state: State) -> None:
        T = self._surroundings.pose(thing, np.append(state.q, state.gripper))
        px, py, pz = T[:3, 3].tolist()
        w, i, j, k = so3.to_quaternion(T[:3, :3]).tolist()
        place(self._coats[thing.name].node, (px, py, pz))
        turn(self._coats[thing.name].node, (w, i, j, k))

    def _mesh(self, name: str, mesh: Any) -> viser.MeshHandle:
        return self._server.scene.add_mesh_simple(name, mesh.vertices, np.asarray(mesh.faces))


def _of_255(colour: tuple[float, float, float]) -> Colour:
    red, green, blue = (round(255.0 * part) for part in colour)
    return red, green, blue
