"""Handles of scene objects, which move them on the table."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import viser

from katana450.arm.control.commands.commands import PlaceObject
from katana450.arm.control.lease import Actor
from katana450.arm.control.objects.loose_objects import check_carried, is_loose
from katana450.arm.control.state.scene_objects import SceneObject
from katana450.arm.control.state.state import State
from katana450.errors import InputError, KatanaError
from katana450.maths.geometry import se3
from katana450.server.view.controls import refuse
from katana450.server.view.layer import LayerContext, ViewLayer
from katana450.server.view.scene import node_name
from katana450.server.viser_bridge.guard import WORKSPACE
from katana450.server.viser_bridge.posing import place

HANDLE = 0.09
"""Length [m] of a handle's arrows: they end outside cup and basin."""


class HandlesLayer(ViewLayer):
    """One hidden handle for each scene object; a page shows that of the object it selects."""

    needs_arm = False

    def attach(self, context: LayerContext) -> None:
        """Prepare for the objects of a session."""
        self._server = context.server
        self._environment = context.session.environment
        self._gestures = context.gestures
        self._handles: dict[str, viser.TransformControlsHandle] = {}
        self._objects: dict[str, SceneObject] = {}
        self._seen: tuple[SceneObject, ...] = ()
        self._dragged: tuple[str, Actor] | None = None

    def follow(self, state: State) -> None:
        """Move the handles with the objects of ``state``."""
        changed = state.objects is not self._seen
        if changed:
            self._take_in(state.objects)
        for scene_object in state.objects:
            if (changed or scene_object.carried) and not self._holds(scene_object.name):
                x, y, z = self._environment.pose(scene_object, state.x)[:3, 3].tolist()
                place(self._handles[scene_object.name], (x, y, z))

    def _take_in(self, objects: tuple[SceneObject, ...]) -> None:
        self._seen = objects
        self._objects = {scene_object.name: scene_object for scene_object in objects}
        for name in set(self._handles) - set(self._objects):
            self._handles.pop(name).remove()
        for name in set(self._objects) - set(self._handles):
            self._handles[name] = self._handle(name)

    def _handle(self, name: str) -> viser.TransformControlsHandle:
        handle = self._server.scene.add_transform_controls(
            f"/handles/{node_name(name)}",
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
        scene_object, actor = self._objects.get(name), self._gestures.actor(event.client_id)
        if event.phase == "start":
            self._dragged = name, actor
        if scene_object is None or scene_object.carried or self._dragged != (name, actor):
            return
        if event.phase == "end":
            self._dragged = None
        x, y, _ = (float(coordinate) for coordinate in event.target.position)
        T = se3.from_rotation_translation(
            scene_object.T[:3, :3], (x, y, float(scene_object.T[2, 3]))
        )
        moved = replace(scene_object, T=T)
        try:
            if is_loose(moved):
                check_carried(self._environment.table, self._seen, moved, may_fall=True)
        except InputError as error:
            # The object stays at the edge, and the handle returns to it.
            if event.phase == "end":
                px, py, pz = scene_object.T[:3, 3].tolist()
                place(self._handles[name], (px, py, pz))
                refuse(event, error)
            return
        # A drag sends 20 messages a second: the next one repeats the request or shows the refusal.
        with suppress(KatanaError):
            self._gestures.submit(PlaceObject(moved), actor)

    def _holds(self, name: str) -> bool:
        dragged = self._dragged
        return dragged is not None and dragged[0] == name and self._gestures.is_current(dragged[1])
