"""What stands around or is held: where it is, and handles to put it elsewhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
import viser

from app.control.commands import Command, Place
from app.control.state import State
from app.control.things import Form, Surroundings, Thing
from app.geometry import se3, so3
from app.geometry.arrays import FloatArray
from app.robot.props import Props
from app.view.guard import WORKSPACE
from app.view.posing import place, turn

HANDLE = 0.09
"""[m] Length of a handle's arrows: they end outside cup and basin."""

COLOUR = (148, 163, 184)

FACETS = 48
"""Of what is round."""


class ThingNodes:
    """A node a thing, made when it first appears and hidden when it is taken away."""

    def __init__(
        self,
        server: viser.ViserServer,
        props: Props,
        surroundings: Surroundings,
        put: Callable[[Command], None],
    ) -> None:
        self._server = server
        self._meshes = {"cup": props.cup.mesh, "basin": props.basin.mesh}
        self._surroundings = surroundings
        self._put = put
        self._nodes: dict[str, Any] = {}
        self._handles: dict[str, viser.TransformControlsHandle] = {}
        self._things: dict[str, Thing] = {}
        self._seen: tuple[Thing, ...] = ()
        self._dragged: str | None = None
        self._wanted = False

    def show_handles(self, visible: bool) -> None:
        """Show or hide the handles."""
        self._wanted = visible
        for name, handle in self._handles.items():
            thing = self._things.get(name)
            handle.visible = visible and thing is not None and not thing.held

    def let_go(self) -> None:
        """Take the handles out of every hand."""
        self._dragged = None

    def node(self, name: str) -> Any:
        """The node of the thing of that name; KeyError when there never was one."""
        return self._nodes[name]

    def follow(self, state: State) -> None:
        """Put everything where ``state`` has it."""
        changed = state.things is not self._seen
        if changed:
            self._take_in(state.things)
        for thing in state.things:
            if changed or thing.held:
                self._pose(thing, np.append(state.q, state.gripper))

    def _take_in(self, things: tuple[Thing, ...]) -> None:
        self._seen = things
        self._things = {thing.name: thing for thing in things}
        for thing in things:
            if thing.name not in self._nodes:
                self._nodes[thing.name] = self._add(thing)
                self._handles[thing.name] = self._handle(thing.name)
        for name, node in self._nodes.items():
            node.visible = name in self._things
        self.show_handles(self._wanted)

    def _pose(self, thing: Thing, x: FloatArray) -> None:
        T = self._surroundings.pose(thing, x)
        px, py, pz = T[:3, 3].tolist()
        w, i, j, k = so3.to_quaternion(T[:3, :3]).tolist()
        place(self._nodes[thing.name], (px, py, pz))
        turn(self._nodes[thing.name], (w, i, j, k))
        if self._dragged != thing.name:
            place(self._handles[thing.name], (px, py, pz))

    def _add(self, thing: Thing) -> Any:
        known = self._meshes.get(thing.name)
        return self._server.scene.add_glb(
            f"/{thing.name}" if known else f"/things/{len(self._nodes)}",
            _plain(thing) if known is None else known.read_bytes(),
        )

    def _handle(self, name: str) -> viser.TransformControlsHandle:
        handle = self._server.scene.add_transform_controls(
            f"/handles/{len(self._handles)}",
            scale=HANDLE,
            line_width=3.0,
            active_axes=(True, True, False),
            disable_rotations=True,
            depth_test=False,
            translation_limits=((-WORKSPACE, WORKSPACE),) * 2 + ((0.0, 0.0),),
            visible=False,
        )

        @handle.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            self._moved(name, event)

        return handle

    def _moved(self, name: str, event: viser.TransformControlsEvent) -> None:
        thing = self._things.get(name)
        if event.phase == "start":
            self._dragged = name
        if thing is None or thing.held or self._dragged != name:
            return
        if event.phase == "end":
            self._dragged = None
        x, y, _ = (float(each) for each in event.target.position)
        T = se3.from_rotation_translation(thing.T[:3, :3], (x, y, float(thing.T[2, 3])))
        self._put(Place(replace(thing, T=T)))


def _plain(thing: Thing) -> bytes:
    """A GLB file of its form."""
    mesh = form(thing)
    mesh.visual.face_colors = (*COLOUR, 255)
    glb: Any = mesh.export(file_type="glb", include_normals=True)
    return bytes(glb)


def form(thing: Thing) -> Any:
    """A trimesh of it on z = 0 of its own frame [m]."""
    match thing.form:
        case Form.BOX:
            mesh = trimesh.creation.box(thing.size)
        case Form.CYLINDER:
            radius, height = thing.size
            mesh = trimesh.creation.cylinder(radius, height, sections=FACETS)
        case _:
            mesh = trimesh.creation.icosphere(subdivisions=3, radius=thing.size[0])
    mesh.apply_translation((0.0, 0.0, 0.5 * thing.height))
    return mesh
