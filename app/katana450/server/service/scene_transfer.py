"""Meshes and scenes on their way in and out: read beside everything else, then asked for by key."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from katana450.arm.control import commands as cmd
from katana450.arm.control.state import State
from katana450.arm.control.things import MOST
from katana450.errors import InputError, LeaseError
from katana450.extensions.importers.meshes import Mesh, Meshes
from katana450.extensions.importers.scene_file import StoredScene, scene_zip
from katana450.extensions.scene.scene import Scene
from katana450.maths.water.units import MILLILITRE, ML
from katana450.server.api import answers

if TYPE_CHECKING:
    from katana450.server.service.interfaces import Arm

KEPT = 4
"""Scenes that were uploaded and not loaded yet."""


class Scenes:
    """Those that wait to be loaded, and the one there is."""

    def __init__(self, meshes: Meshes) -> None:
        self._meshes = meshes
        self._kept: dict[str, StoredScene] = {}

    def keep_mesh(self, mesh: Mesh, state: State | None) -> answers.Mesh:
        """``mesh`` can be placed from now on. Raises InputError where there is no room for it."""
        self._meshes.put([mesh], used_in(state))
        names = {thing.name for thing in state.things} if state is not None else set()
        return answers.Mesh(
            key=mesh.key,
            name=free_name(mesh.name, names),
            said=mesh.said,
            size=list(mesh.solid.size),
            triangles=len(mesh.faces),
        )

    def keep(self, data: bytes, stored: StoredScene, arm: Arm) -> answers.Scene:
        """``stored``, which came as ``data``, can be loaded from now on.

        Raises InputError where that cannot be.
        """
        arm.rig.session.check(_furnishing(stored))
        self._meshes.put(stored.meshes, used_in(arm.state))
        names = [thing.name for thing in stored.scene.things]
        key = hashlib.sha256(data).hexdigest()[:32]
        self._kept[key] = stored
        while len(self._kept) > KEPT:
            self._kept.pop(next(iter(self._kept)))
        said = f"{len(names)} thing{'' if len(names) == 1 else 's'}: {', '.join(names) or 'none'}."
        if stored.scene.joints is not None:
            said += " The arm stays where it is."
        return answers.Scene(key=key, things=names, said=said)

    def furnishing(self, key: str, arm: Arm) -> cmd.Furnish:
        """What loads the scene. Raises InputError, LeaseError with the reason why not."""
        stored = self._kept.get(key)
        if stored is None:
            raise InputError("There is no scene of that key, or no more: upload it again.")
        held = arm.state.held
        if held is not None:
            raise LeaseError(f"{held.name!r} is held: open the gripper first.")
        self._meshes.put(stored.meshes, used_in(arm.state))
        return _furnishing(stored)

    def stored(self, arm: Arm) -> StoredScene:
        """What there is now. Raises InputError, LeaseError where that cannot be saved."""
        state = arm.state
        held = state.held
        if held is not None:
            raise LeaseError(
                f"{held.name!r} is held: set it down first, a scene has nothing in hand."
            )
        water = None
        if state.poured is not None:
            water = ML * state.poured.water.cup / MILLILITRE
        keys = dict.fromkeys(t.solid.key for t in state.things if t.solid is not None)
        meshes = tuple(self._meshes.need(key) for key in keys)
        return StoredScene(Scene(state.things, water, state.q), meshes)

    def zipped(self, arm: Arm) -> bytes:
        """The same as a file."""
        hand = arm.surroundings.hand
        return scene_zip(self.stored(arm), None if hand is None else hand.T_palm_tool)


def used_in(state: State | None) -> frozenset[str]:
    """The keys of the meshes that things are of."""
    things = () if state is None else state.things
    return frozenset(thing.solid.key for thing in things if thing.solid is not None)


def free_name(name: str, taken: set[str]) -> str:
    """``name``, with a number behind it where a thing has it."""
    tried = [name, *(f"{name[:36]} {number}" for number in range(2, MOST + 3))]
    return next(each for each in tried if each not in taken)


def _furnishing(stored: StoredScene) -> cmd.Furnish:
    return cmd.Furnish(stored.scene.things, stored.scene.water)
