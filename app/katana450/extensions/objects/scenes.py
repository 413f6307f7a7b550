"""Uploaded scenes that wait to be loaded, and free names for objects."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple
from weakref import WeakKeyDictionary

from katana450.arm.control.commands import commands as cmd
from katana450.arm.control.state.scene_objects import MAX_OBJECTS
from katana450.arm.control.state.state import State
from katana450.arm.robot.object_meshes import Mesh, Meshes
from katana450.errors import InputError, LeaseError

if TYPE_CHECKING:
    from katana450.server.service.arm_handle import ArmHandle
    from katana450.server.service.hub import Hub

MAX_WAITING_SCENES = 4
"""Maximum number of uploaded scenes that are not loaded yet."""


class _Waiting(NamedTuple):
    command: cmd.ReplaceScene
    meshes: tuple[Mesh, ...]


class Scenes:
    """Uploaded scenes by their keys: the command that loads each, and the meshes of its objects."""

    def __init__(self, meshes: Meshes) -> None:
        self._meshes = meshes
        self._waiting: dict[str, _Waiting] = {}

    def keep(
        self, key: str, command: cmd.ReplaceScene, meshes: Collection[Mesh], arm: ArmHandle
    ) -> None:
        """Keep a scene under ``key``, and drop the oldest if there are too many.

        Raises InputError if ``arm`` refuses the scene, or there is no room for ``meshes``.
        """
        arm.session.check(command)
        self._meshes.put(meshes, used_in(arm.state))
        self._waiting[key] = _Waiting(command, tuple(meshes))
        while len(self._waiting) > MAX_WAITING_SCENES:
            self._waiting.pop(next(iter(self._waiting)))

    def load_command(self, key: str, arm: ArmHandle) -> cmd.ReplaceScene:
        """Return the command that loads the scene.

        Raises InputError for an unknown key, and LeaseError while an object is held.
        """
        waiting = self._waiting.get(key)
        if waiting is None:
            raise InputError(f"There is no scene {key!r}, or it was dropped. Upload it again.")
        held = arm.state.held
        if held is not None:
            raise LeaseError(f"{held.name!r} is held: open the gripper first.")
        self._meshes.put(waiting.meshes, used_in(arm.state))
        return waiting.command


_SCENES: WeakKeyDictionary[Hub, Scenes] = WeakKeyDictionary()


def scenes_of(hub: Hub) -> Scenes:
    """Return the scenes that wait on the server of ``hub``."""
    return _SCENES.setdefault(hub, Scenes(hub.meshes))


def used_in(state: State | None) -> frozenset[str]:
    """Return the keys of the meshes of the objects in ``state``."""
    objects = () if state is None else state.objects
    return frozenset(
        scene_object.solid.key for scene_object in objects if scene_object.solid is not None
    )


def free_name(name: str, names: set[str]) -> str:
    """Return ``name``, with a number appended if it is one of ``names``."""
    candidates = [name, *(f"{name[:36]} {number}" for number in range(2, MAX_OBJECTS + 3))]
    return next(candidate for candidate in candidates if candidate not in names)
