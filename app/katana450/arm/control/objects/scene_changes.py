"""Transforms of a state by the commands about objects: their places and water."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.commands.object_commands import MoveObject
from katana450.arm.control.objects.environment import Environment
from katana450.arm.control.objects.pouring import Pouring
from katana450.arm.control.state.scene_objects import SceneObject, placed, with_replaced
from katana450.arm.control.state.state import State


def with_scene_change(
    environment: Environment, pouring: Pouring | None, state: State, command: cmd.Command
) -> State:
    """Return ``state`` after a command about objects or the water."""
    x = state.x_setpoint
    match command:
        case cmd.PlaceObject(scene_object=scene_object):
            return replace(state, objects=placed(state.objects, scene_object))
        case cmd.Remove(name=name):
            return removed(state, name)
        case cmd.MoveObject():
            return with_moved_object(state, command)
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
