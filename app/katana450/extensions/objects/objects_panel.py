"""The panel of scene objects: choose one, and colour, scale, turn, attach or remove it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import viser

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.pouring import BASIN, CUP
from katana450.arm.control.objects.support import check_mounted
from katana450.arm.control.state.scene_objects import (
    MAX_SCALE,
    MIN_SCALE,
    Attachment,
    SceneObject,
    named,
)
from katana450.arm.control.state.solid import MIN_OPACITY, ObjectAppearance
from katana450.arm.control.state.state import State
from katana450.errors import InputError, KatanaError
from katana450.maths.geometry import so3
from katana450.maths.geometry.arrays import frozen
from katana450.server.view.controls import GestureGate, refuse, set_value
from katana450.server.view.panel_folder import SCENE, FolderContext
from katana450.server.view.scene_objects import COLOUR

NOTHING = "nothing yet"
"""The only choice while there are no objects."""

MOUNTS = {"Hand": Attachment.HAND, "Table": Attachment.TABLE, "Here": Attachment.WORLD}

OWN, REMOVE = "Own colour", "Remove"


class ObjectsFolder:
    """The folder "Objects" in the tab "Scene"."""

    def __init__(self, context: FolderContext) -> None:
        """Add the controls."""
        self._hub = context.hub
        with context.tabs.tab(SCENE), context.server.gui.add_folder("Objects"):
            self._panel = ObjectsPanel(
                context.server,
                context.gestures,
                context.state,
                lambda: context.hub.present().environment,
            )

    def follow(self) -> None:
        """Show the objects of the newest state."""
        arm = self._hub.arm
        if arm is not None:
            self._panel.follow(arm.state, caught_up=arm.caught_up)


class ObjectsPanel:
    """The controls for the chosen scene object."""

    def __init__(
        self,
        server: viser.ViserServer,
        gestures: GestureGate,
        state: Callable[[], State],
        environment: Callable[[], Environment],
    ) -> None:
        """Add the controls to the open folder of ``server``.

        Args:
            server: viser's server.
            gestures: The path of gestures to the arm.
            state: Returns the newest state.
            environment: Returns the supports and links to which objects can be fixed.
        """
        self._environment = environment
        self._gestures = gestures
        self._state = state
        self._objects = state().objects
        self._shown: SceneObject | None = None
        gui = server.gui
        names = _names(self._objects)
        self._choice = gui.add_dropdown(
            "Object", names, hint="The controls below are for this object"
        )
        self._colour = gui.add_rgb("Colour", COLOUR)
        self._opacity = gui.add_slider(
            "Opacity",
            min=100.0 * MIN_OPACITY,
            max=100.0,
            step=1.0,
            initial_value=100.0,
            hint="Percent. It does not change the collision checks",
        )
        self._scale = gui.add_number(
            "Scale",
            1.0,
            min=MIN_SCALE,
            max=MAX_SCALE,
            step=0.001,
            hint="Relative to the original size",
        )
        self._turn = gui.add_slider(
            "Turn",
            min=-180.0,
            max=180.0,
            step=1.0,
            initial_value=0.0,
            hint="About the vertical, in degrees",
        )
        self._hidden = gui.add_checkbox(
            "Hidden", initial_value=False, hint="Not drawn. The arm still keeps clear of it"
        )
        self._mounts = gui.add_button_group(
            "Attach to",
            tuple(MOUNTS),
            hint="Hand: it moves with the hand as a part of it. Table: it is set down on the "
            "table below. Here: it stays where it is, even in the air",
        )
        self._acts = gui.add_button_group("And", (OWN, REMOVE))
        self._on(self._colour, lambda scene_object: _recoloured(scene_object, self._colour.value))
        self._on(
            self._opacity,
            lambda scene_object: _looking(
                scene_object, opacity=max(0.01 * self._opacity.value, MIN_OPACITY)
            ),
        )
        self._on(self._scale, lambda scene_object: _scaled(scene_object, self._scale.value))
        self._on(
            self._turn, lambda scene_object: _turned(scene_object, math.radians(self._turn.value))
        )
        self._on(
            self._hidden, lambda scene_object: _looking(scene_object, hidden=self._hidden.value)
        )
        self._on(self._mounts, self._mounted)
        self._on(self._acts, self._acted)
        self._choice.on_update(lambda _: self._show(self._chosen(), again=True))
        self._show(self._chosen(), again=True)

    def follow(self, state: State, *, caught_up: bool) -> None:
        """Show the objects of ``state``. ``caught_up``: see ``Panel.follow``."""
        if not caught_up:
            return
        self._objects = state.objects
        names = _names(state.objects)
        if names != tuple(self._choice.options):
            new = [name for name in names if name not in self._choice.options]
            chosen = self._choice.value
            self._choice.options = names
            if new or chosen not in names:
                # A new object becomes the chosen one.
                chosen = new[-1] if new else names[0]
            set_value(self._choice, chosen)
        self._show(self._chosen())

    def _chosen(self) -> SceneObject | None:
        return named(self._objects, self._choice.value)

    def _show(self, scene_object: SceneObject | None, *, again: bool = False) -> None:
        if scene_object is None or (scene_object is self._shown and not again):
            return
        self._shown = scene_object
        set_value(self._colour, scene_object.appearance.colour or COLOUR)
        set_value(self._opacity, round(100.0 * scene_object.appearance.opacity, 1))
        set_value(self._scale, scene_object.scale)
        set_value(self._hidden, scene_object.appearance.hidden)
        yaw = math.degrees(so3.to_rpy(scene_object.T[:3, :3])[2])
        if abs(math.remainder(self._turn.value - yaw, 360.0)) > 0.5:
            set_value(self._turn, round(yaw) + 0.0)

    def _mounted(self, scene_object: SceneObject) -> cmd.Command:
        to, state = MOUNTS[self._mounts.value], self._state()
        check_mounted(self._environment(), state.objects, scene_object, to, state.x)
        return cmd.Attach(scene_object.name, to)

    def _acted(self, scene_object: SceneObject) -> cmd.Command:
        if self._acts.value == REMOVE:
            if scene_object.held:
                raise InputError(f"{scene_object.name!r} is held: open the gripper first.")
            return cmd.Remove(scene_object.name)
        return _looking(scene_object, colour=None)

    def _on(self, handle: Any, make: Callable[[SceneObject], cmd.Command]) -> None:
        """Send the command that ``make`` returns for the chosen object when ``handle`` changes."""

        async def changed(event: viser.GuiEvent[Any]) -> None:
            if event.client_id is None:
                return
            try:
                # The objects that are shown may be older than those of the newest state.
                self._objects = self._state().objects
                scene_object = self._chosen()
                if scene_object is None:
                    raise InputError("There is no object: add one first.")
                self._gestures.submit(make(scene_object), self._gestures.actor(event.client_id))
            except KatanaError as error:
                self._show(self._chosen(), again=True)
                refuse(event, error)

        if isinstance(handle, viser.GuiButtonGroupHandle):
            handle.on_click(changed)
        else:
            handle.on_update(changed)


def _placed(scene_object: SceneObject, **changes: Any) -> cmd.Command:
    if scene_object.held:
        raise InputError(f"{scene_object.name!r} is held: open the gripper first.")
    return cmd.PlaceObject(replace(scene_object, **changes))


def _looking(scene_object: SceneObject, **changes: Any) -> cmd.Command:
    return _placed(scene_object, appearance=replace(scene_object.appearance, **changes))


def _recoloured(scene_object: SceneObject, value: tuple[int, int, int]) -> cmd.Command:
    red, green, blue = (int(part) for part in value)
    return _placed(
        scene_object,
        appearance=ObjectAppearance(
            (red, green, blue), scene_object.appearance.opacity, scene_object.appearance.hidden
        ),
    )


def _scaled(scene_object: SceneObject, scale: float) -> cmd.Command:
    if scene_object.name in (CUP, BASIN):
        raise InputError(
            f"The {scene_object.name} cannot be scaled: the water model depends on its size."
        )
    return _placed(scene_object, scale=float(scale))


def _turned(scene_object: SceneObject, yaw: float) -> cmd.Command:
    """Return the command that sets the yaw [rad] of ``scene_object`` in its own frame."""
    roll, pitch, _ = so3.to_rpy(scene_object.T[:3, :3])
    T = np.array(scene_object.T)
    T[:3, :3] = so3.from_rpy(roll, pitch, yaw)
    return _placed(scene_object, T=frozen(T))


def _names(objects: tuple[SceneObject, ...]) -> tuple[str, ...]:
    return tuple(scene_object.name for scene_object in objects) or (NOTHING,)
