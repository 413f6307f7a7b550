"""Transforms of a state by the commands about objects: their places, water and appearance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.object_commands import MoveObject, SetAppearance
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.pouring import Pouring
from katana450.arm.control.state import solid
from katana450.arm.control.state.appearance import DisplayMode, LinkAppearance
from katana450.arm.control.state.scene_objects import SceneObject, named, placed, with_replaced
from katana450.arm.control.state.state import State


def with_scene_change(
    environment: Environment, pouring: Pouring | None, state: State, command: cmd.Command
) -> State:
    """Return ``state`` after a command about objects, the water, or the appearance."""
    x = state.x_setpoint
    match command:
        case cmd.PlaceObject(scene_object=scene_object):
            return replace(state, objects=placed(state.objects, scene_object))
        case cmd.Remove(name=name):
            return removed(state, name)
        case cmd.MoveObject():
            return with_moved_object(state, command)
        case cmd.SetAppearance():
            return with_appearance(state, command)
        case cmd.Attach(name=name, to=to):
            mounted = tuple(
                environment.mounted(other, to, x) if other.name == name else other
                for other in state.objects
            )
            return replace(state, objects=mounted)
        case cmd.ReplaceScene(objects=objects, volume=volume):
            replaced = replace(state, objects=with_replaced(state.objects, objects))
            return with_water(pouring, replaced, volume)
        case cmd.Fill(volume=volume):
            return with_water(pouring, state, volume)
    raise AssertionError(f"The table of transitions has no rule for {command!r}.")


def with_water(pouring: Pouring | None, state: State, volume: float | None) -> State:
    """Return ``state`` with ``volume`` [m^3] in the cup; None for no water."""
    if volume is None:
        return replace(state, poured=None)
    assert pouring is not None
    return replace(state, poured=pouring.fill(volume, state.objects, state.x_setpoint))


def removed(state: State, name: str) -> State:
    """Return ``state`` without the object of that name; a held object stays."""
    objects = tuple(
        scene_object
        for scene_object in state.objects
        if scene_object.held or scene_object.name != name
    )
    return replace(state, objects=objects)


def with_moved_object(state: State, command: MoveObject) -> State:
    """Return ``state`` with the object moved, unless the hand carries it or it is on a joint."""

    def moved(scene_object: SceneObject) -> SceneObject:
        if scene_object.name != command.name or not scene_object.can_be_moved:
            return scene_object
        T = np.array(scene_object.T)
        if command.position is not None:
            T[:3, 3] = command.position
        if command.R is not None:
            T[:3, :3] = command.R
        return replace(scene_object, T=T)

    return replace(state, objects=tuple(map(moved, state.objects)))


def appearance_of(state: State, name: str) -> LinkAppearance:
    """Return the appearance of the link or object of that name."""
    scene_object = named(state.objects, name)
    return state.appearance.of(name) if scene_object is None else _as_link(scene_object.appearance)


def with_appearance(state: State, command: SetAppearance) -> State:
    """Return ``state`` with one trait of an appearance changed.

    The appearance of an object is part of the object; that of a link is part of the state.
    """

    def changed(scene_object: SceneObject) -> SceneObject:
        if scene_object.name != command.name:
            return scene_object
        appearance = _as_link(scene_object.appearance).having(command.trait, command.value)
        return replace(scene_object, appearance=_as_object(appearance))

    if any(other.name == command.name for other in state.objects):
        return replace(state, objects=tuple(map(changed, state.objects)))
    appearance = state.appearance.having(command.name, command.trait, command.value)
    return replace(state, appearance=appearance)


PAINT = (204, 204, 204)
"""Default colour of a painted object, red, green, blue of 255."""


def _as_link(appearance: solid.ObjectAppearance) -> LinkAppearance:
    """Return the appearance of an object in the form of a link's."""
    painted = appearance.colour is not None or appearance.opacity < 1.0
    choice = DisplayMode.PAINTED if painted else DisplayMode.MADE
    if appearance.hidden:
        choice = DisplayMode.HIDDEN
    if appearance.colour is None:
        return LinkAppearance(choice, None, 1.0 - appearance.opacity)
    red, green, blue = (part / 255.0 for part in appearance.colour)
    return LinkAppearance(choice, (red, green, blue), 1.0 - appearance.opacity)


def _as_object(appearance: LinkAppearance) -> solid.ObjectAppearance:
    """Return the appearance of a link in the form of an object's.

    An object that is shown as it is made keeps no paint.
    """
    if appearance.choice is DisplayMode.MADE:
        return solid.PLAIN
    colour = None if appearance.choice is DisplayMode.HIDDEN else PAINT
    if appearance.colour is not None:
        red, green, blue = (round(255.0 * part) for part in appearance.colour)
        colour = red, green, blue
    opacity = max(1.0 - appearance.transparency, solid.MIN_OPACITY)
    return solid.ObjectAppearance(colour, opacity, appearance.choice is DisplayMode.HIDDEN)
