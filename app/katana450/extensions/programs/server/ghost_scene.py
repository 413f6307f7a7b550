"""Ghosts of the objects and of the water at a time of a preview."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import viser

from katana450.arm.control.pouring import MotionWithWater
from katana450.arm.control.scene_objects import SceneObject
from katana450.arm.control.session import Session
from katana450.arm.control.state import State
from katana450.arm.robot.object_meshes import Meshes
from katana450.arm.robot.props import load_props
from katana450.maths.geometry import so3
from katana450.server.view.scene import Colour
from katana450.server.view.scene_objects import ObjectShape
from katana450.server.view.water import WaterNodes

ROOT = "/path/objects"
"""Node above all ghosts of objects."""

WATER = "/path/water"
"""Node above the ghost of the water."""

SAME_PLACE = 1e-4
"""Change of a pose [m or 1] up to which an object counts as unmoved, and has no ghost."""


class GhostScene:
    """The objects that a program has moved by some time, and its water, in one colour."""

    def __init__(self, server: viser.ViserServer, colour: Colour, opacity: float) -> None:
        """Prepare the ghosts; each is sent when it is first shown."""
        self._server = server
        self._colour = colour
        self._opacity = opacity
        props = load_props()
        self._props = {"cup": props.cup.mesh, "basin": props.basin.mesh}
        self._shapes: dict[str, tuple[viser.FrameHandle, ObjectShape]] = {}
        self._water: WaterNodes | None = None

    def prepare(self, objects: Iterable[SceneObject]) -> None:
        """Send hidden ghosts of ``objects``: reading the shape of one can take a second."""
        for scene_object in objects:
            self._drawn(scene_object)

    def show(self, session: Session, start: State, state: State) -> None:
        """Show what differs in ``state`` from ``start``, both of ``session``."""
        now = {each.name: each for each in start.objects}
        shown = set()
        for scene_object in state.objects:
            T = session.environment.pose(scene_object, state.x)
            before = now.get(scene_object.name)
            if before is not None:
                change = np.abs(T - session.environment.pose(before, start.x)).max()
                if change <= SAME_PLACE:
                    continue
            frame = self._drawn(scene_object)
            frame.position, frame.wxyz = T[:3, 3], so3.to_quaternion(T[:3, :3])
            frame.visible = True
            shown.add(scene_object.name)
        for name, (frame, _) in self._shapes.items():
            if name not in shown:
                frame.visible = False
        self._show_water(session, state, changed=_amounts(start.poured) != _amounts(state.poured))

    def hide(self) -> None:
        """Hide all ghosts."""
        for frame, _ in self._shapes.values():
            frame.visible = False
        if self._water is not None:
            self._water.hide()

    def _drawn(self, scene_object: SceneObject) -> viser.FrameHandle:
        name = scene_object.name
        if name not in self._shapes:
            path = f"{ROOT}/{len(self._shapes)}"
            frame = self._server.scene.add_frame(path, show_axes=False, visible=False)
            # A mesh is shown as the convex body that the collision checks use.
            shape = ObjectShape(self._server, path, Meshes(), self._props.get(name))
            self._shapes[name] = frame, shape
        frame, shape = self._shapes[name]
        look = replace(scene_object.appearance, colour=self._colour, opacity=self._opacity)
        shape.follow(replace(scene_object, appearance=look))
        return frame

    def _show_water(self, session: Session, state: State, *, changed: bool) -> None:
        pouring, poured = session.pouring, state.poured
        if pouring is None or poured is None or not changed:
            if self._water is not None:
                self._water.hide()
            return
        water_environment = pouring.water_environment(state.objects)
        if self._water is None:
            self._water = WaterNodes(self._server, water_environment, WATER)
        self._water.stand(water_environment)
        self._water.show(poured.water)


def _amounts(poured: MotionWithWater | None) -> tuple[int, int]:
    """Return the water in the cup and in the basin [fl]."""
    return (0, 0) if poured is None else (poured.water.cup, poured.water.basin)
