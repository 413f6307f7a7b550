"""Ghosts of the objects and of the water at a time of a preview."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import viser

from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.extensions.water.nodes import WaterNodes
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import FloatArray
from katana450.maths.water.flow import Water
from katana450.maths.water.motion import MotionWithWater
from katana450.server.view.scene import Colour, Window
from katana450.server.view.scene_objects import ObjectShape

ROOT = "/path"
"""Node above all ghosts of a preview."""

SAME_PLACE = 1e-4
"""Change of a pose [m or 1] up to which an object counts as unmoved, and has no ghost."""


class GhostScene:
    """Objects and water at some time: what a program has moved, or what was recorded."""

    def __init__(
        self, server: Window, colour: Colour | None, opacity: float, root: str = ROOT
    ) -> None:
        """Prepare the ghosts below the node ``root``; each is sent when it is first shown.

        ``colour``: that of all objects; None to draw each as it is. ``server``: the server, or one
        of its clients, which alone shows them then.
        """
        self._server = server
        self._root = root
        self._colour = colour
        self._opacity = opacity
        self._props = load_props()
        self._shapes: dict[str, tuple[viser.FrameHandle, ObjectShape]] = {}
        self._water: WaterNodes | None = None

    def prepare(self, objects: Iterable[SceneObject]) -> None:
        """Send hidden ghosts of ``objects``: reading the shape of one can take a second."""
        for scene_object in objects:
            self._drawn(scene_object)

    def show(self, session: Session, start: State, state: State) -> None:
        """Show what differs in ``state`` from ``start``, both of ``session``."""
        now = {each.name: each for each in start.objects}
        moved = []
        for scene_object in state.objects:
            T = session.environment.pose(scene_object, state.x)
            before = now.get(scene_object.name)
            if before is not None:
                change = np.abs(T - session.environment.pose(before, start.x)).max()
                if change <= SAME_PLACE:
                    continue
            moved.append((scene_object, T))
        self.place(moved)
        changed = _amounts(start.poured) != _amounts(state.poured)
        self.pour(session, state.objects, state.poured.water if state.poured and changed else None)

    def place(self, poses: Iterable[tuple[SceneObject, FloatArray]]) -> None:
        """Show these objects in their poses (4, 4) in the base frame, and no others."""
        shown = set()
        for scene_object, T in poses:
            frame = self._drawn(scene_object)
            frame.position, frame.wxyz = T[:3, 3], so3.to_quaternion(T[:3, :3])
            frame.visible = True
            shown.add(scene_object.name)
        for name, (frame, _) in self._shapes.items():
            if name not in shown:
                frame.visible = False

    def hide(self) -> None:
        """Hide all ghosts."""
        for frame, _ in self._shapes.values():
            frame.visible = False
        if self._water is not None:
            self._water.hide()

    def _drawn(self, scene_object: SceneObject) -> viser.FrameHandle:
        name = scene_object.name
        if name not in self._shapes:
            path = f"{self._root}/objects/{len(self._shapes)}"
            frame = self._server.scene.add_frame(path, show_axes=False, visible=False)
            # A mesh is shown as the convex body that the collision checks use.
            shape = ObjectShape(self._server, path, Meshes(), self._props)
            self._shapes[name] = frame, shape
        frame, shape = self._shapes[name]
        look = scene_object.appearance
        if self._colour is not None:
            look = replace(look, colour=self._colour, opacity=self._opacity)
        shape.follow(replace(scene_object, appearance=look))
        return frame

    def pour(self, session: Session, objects: Sequence[SceneObject], water: Water | None) -> None:
        """Show ``water`` among ``objects``; hide it if there is none."""
        pouring = session.pouring
        if pouring is None or water is None:
            if self._water is not None:
                self._water.hide()
            return
        water_environment = pouring.water_environment(objects)
        if self._water is None:
            self._water = WaterNodes(self._server, water_environment, f"{self._root}/water")
        self._water.stand(water_environment)
        self._water.show(water)


def _amounts(poured: MotionWithWater | None) -> tuple[int, ...]:
    """Return the water in the basin and in the vessels [fl]."""
    if poured is None:
        return (0, 0)
    return poured.water.basin, *(each.volume for each in poured.water.vessels)
