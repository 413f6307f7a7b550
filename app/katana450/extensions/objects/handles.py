"""Handles of scene objects: arrows move them, and others change a box's size or turn a plane."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import viser

from katana450.arm.control.commands.commands import PlaceObject
from katana450.arm.control.lease import Actor
from katana450.arm.control.objects.loose_objects import check_carried, is_loose
from katana450.arm.control.state.scene_objects import MAX_SIZE, MIN_SIZE, SceneObject, Shape
from katana450.arm.control.state.state import State
from katana450.errors import InputError, KatanaError
from katana450.maths.geometry import se3, so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.server.view.controls import refuse
from katana450.server.view.layer import LayerContext, ViewLayer
from katana450.server.view.scene import node_name
from katana450.server.viser_bridge.guard import WORKSPACE
from katana450.server.viser_bridge.posing import place, turn

HANDLE = 0.09
"""Length [m] of a handle's arrows: they end outside cup and basin."""

SIZE_HANDLE = 0.06
"""Length [m] of the arrows at a corner of a box, which change its size."""

SECOND_HANDLES = {Shape.BOX: "size", Shape.PLANE: "turn"}
"""Names of the handles below those that move an object."""

Event = viser.TransformControlsEvent


class HandlesLayer(ViewLayer):
    """Hidden handles for each scene object; a page shows those of the object it selects."""

    needs_arm = False

    def attach(self, context: LayerContext) -> None:
        """Prepare for the objects of a session."""
        self._server = context.server
        self._environment = context.session.environment
        self._gestures = context.gestures
        self._handles: dict[str, viser.TransformControlsHandle] = {}
        self._second: dict[str, viser.TransformControlsHandle] = {}
        self._kinds: dict[str, tuple[object, ...]] = {}
        self._objects: dict[str, SceneObject] = {}
        self._seen: tuple[SceneObject, ...] = ()
        self._dragged: tuple[str, Actor] | None = None
        self._start: SceneObject | None = None

    def follow(self, state: State) -> None:
        """Move the handles with the objects of ``state``."""
        changed = state.objects is not self._seen
        if changed:
            self._take_in(state.objects)
        for scene_object in state.objects:
            if (changed or scene_object.carried) and not self._holds(scene_object.name):
                self._put(scene_object, self._environment.pose(scene_object, state.x))

    def _put(self, scene_object: SceneObject, T: FloatArray) -> None:
        """Put the handles of ``scene_object`` to its pose ``T`` (4, 4) in the base frame."""
        x, y, z = T[:3, 3].tolist()
        place(self._handles[scene_object.name], (x, y, z))
        second = self._second.get(scene_object.name)
        if second is None:
            return
        w, i, j, k = so3.to_quaternion(T[:3, :3]).tolist()
        turn(second, (w, i, j, k))
        if scene_object.shape is Shape.BOX:
            x, y, z = (T[:3, :3] @ (_SHARES * scene_object.extent)).tolist()
            place(second, (x, y, z))

    def _take_in(self, objects: tuple[SceneObject, ...]) -> None:
        self._seen = objects
        self._objects = {scene_object.name: scene_object for scene_object in objects}
        kinds = {item.name: (item.shape, item.is_zone) for item in objects}
        for name in [name for name, kind in self._kinds.items() if kinds.get(name) != kind]:
            if name in self._second:
                self._second.pop(name).remove()
            self._handles.pop(name).remove()
            del self._kinds[name]
        for name in set(kinds) - set(self._kinds):
            self._kinds[name] = kinds[name]
            self._add(self._objects[name])

    def _add(self, scene_object: SceneObject) -> None:
        path = f"/handles/{node_name(scene_object.name)}"
        # A zone may hang in the air, other objects are moved on the table.
        height = WORKSPACE if scene_object.is_zone else 0.0
        self._handles[scene_object.name] = self._handle(
            path,
            partial(self._moved, scene_object.name),
            scale=HANDLE,
            active_axes=(True, True, scene_object.is_zone),
            disable_rotations=True,
            translation_limits=((-WORKSPACE, WORKSPACE),) * 2 + ((-height, height),),
            visible=False,
        )
        second = SECOND_HANDLES.get(scene_object.shape)
        if second is not None:
            sizes = second == "size"
            self._second[scene_object.name] = self._handle(
                f"{path}/{second}",
                partial(self._resized if sizes else self._turned, scene_object.name),
                scale=SIZE_HANDLE if sizes else HANDLE,
                disable_axes=not sizes,
                disable_rotations=sizes,
            )

    def _handle(
        self, path: str, changed: Callable[[Event], None], **properties: Any
    ) -> viser.TransformControlsHandle:
        handle = self._server.scene.add_transform_controls(
            path, line_width=3.0, disable_sliders=True, depth_test=False, **properties
        )

        @handle.on_update
        async def _(event: Event) -> None:
            changed(event)

        return handle

    def _moved(self, name: str, event: Event) -> None:
        scene_object = self._objects.get(name)
        if scene_object is None:
            return
        x, y, z = (float(coordinate) for coordinate in event.target.position)
        if not scene_object.is_zone:
            z = float(scene_object.T[2, 3])
        T = se3.from_rotation_translation(scene_object.T[:3, :3], (x, y, z))
        self._change(event, replace(scene_object, T=T))

    def _resized(self, name: str, event: Event) -> None:
        """Move a corner of a box; the opposite one, at its underside, stays."""
        scene_object, start = self._objects.get(name), self._start
        if event.phase == "start" or start is None:
            start = scene_object
        if scene_object is None or start is None or start.name != name:
            return
        corner = start.T[:3, :3].T @ event.target.position
        extent = np.clip(corner + (1.0 - _SHARES) * start.extent, MIN_SIZE, MAX_SIZE)
        shift = _SHARES * (extent - start.extent) * (1.0, 1.0, 0.0)
        T = start.T @ se3.from_rotation_translation(np.eye(3), shift)
        size = tuple((extent / scene_object.scale).tolist())
        self._change(event, replace(scene_object, T=T, size=size))

    def _turned(self, name: str, event: Event) -> None:
        scene_object = self._objects.get(name)
        if scene_object is not None:
            R = so3.from_quaternion(np.asarray(event.target.wxyz, dtype=float))
            T = se3.from_rotation_translation(R, scene_object.T[:3, 3])
            self._change(event, replace(scene_object, T=T))

    def _change(self, event: Event, changed: SceneObject) -> None:
        """Submit an object that a drag has changed."""
        name, actor = changed.name, self._gestures.actor(event.client_id)
        scene_object = self._objects[name]
        if event.phase == "start":
            self._dragged, self._start = (name, actor), scene_object
        if not scene_object.can_be_moved or self._dragged != (name, actor):
            return
        if event.phase == "end":
            self._dragged = None
        try:
            if is_loose(changed):
                check_carried(self._environment.table, self._seen, changed, may_fall=True)
        except InputError as error:
            # The object stays at the edge, and the handle returns to it.
            if event.phase == "end":
                self._put(scene_object, scene_object.T)
                refuse(event, error)
            return
        # A drag sends 20 messages a second: the next one repeats the request or shows the refusal.
        with suppress(KatanaError):
            self._gestures.submit(PlaceObject(changed), actor)

    def _holds(self, name: str) -> bool:
        dragged = self._dragged
        return dragged is not None and dragged[0] == name and self._gestures.is_current(dragged[1])


_SHARES = np.array((0.5, 0.5, 1.0))
"""The corner with the handle, from the origin of a box, as fractions of its size."""
